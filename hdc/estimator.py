"""scikit-learn's conventions, without importing it.

Importing its base class takes as long as importing torch, and 100 MB; this package takes a
hundredth of either.
"""

from __future__ import annotations

import inspect
from typing import Any, Self

from hdc import inputs


class Estimator:
    """Parameters by name, tags, and how an untrained model is refused."""

    _estimator_type: str

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Constructor parameters by name."""
        names = inspect.signature(type(self).__init__).parameters
        return {name: getattr(self, name) for name in names if name != "self"}

    def set_params(self, **params: Any) -> Self:
        """Set constructor parameters by name."""
        for name, value in params.items():
            if name not in self.get_params():
                raise ValueError(
                    f"set_params: expected one of {', '.join(self.get_params())}, found {name!r}"
                )
            setattr(self, name, value)
        return self

    def _not_trained(self) -> ValueError:
        """The error of a model that was not trained; scikit-learn's, where that is loaded."""
        kind = inputs.of_sklearn("NotFittedError", ValueError)
        return kind(f"{type(self).__name__}: expected a trained model; call fit first")

    def _adopt(self, trained: Self) -> None:
        """Take over all that another model of the same parameters has learned."""
        parameters = self.get_params()
        learned = {k: v for k, v in vars(trained).items() if k not in parameters}
        for name in [n for n in vars(self) if n.endswith("_") and n not in learned]:
            delattr(self, name)
        vars(self).update(learned)

    def __repr__(self) -> str:
        parameters = ", ".join(f"{k}={v!r}" for k, v in self.get_params().items())
        return f"{type(self).__name__}({parameters})"

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, RegressorTags, Tags, TargetTags

        # A median threshold leaves one bit of two features: no blob is told from its mirror.
        classifier = self._estimator_type == "classifier"
        return Tags(
            estimator_type=self._estimator_type,
            target_tags=TargetTags(required=True, multi_output=not classifier),
            classifier_tags=ClassifierTags(poor_score=True) if classifier else None,
            regressor_tags=None if classifier else RegressorTags(poor_score=True),
            input_tags=InputTags(two_d_array=True, three_d_array=True),
        )
