"""Tensors of a saved model: what each part of it keeps, by name, and whether a file has that."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from torch import Tensor

from hdc import bits

Kinds = Mapping[str, str]
"""Name → type and axes, such as ``"int64 L 4 W"``: a letter is a size, W words of D bits each."""


def checked(
    tensors: Mapping[str, Tensor], kinds: Kinds, **sizes: int
) -> dict[str, Tensor]:
    """These tensors, of these kinds; all but words are moved to the CPU.

    Args:
        tensors: of a file, which may be anything.
        kinds: of all of them.
        sizes: of letters; one without is any size above zero, the same everywhere. With D, words
            have no ones beyond it.

    Raises:
        ValueError: for a tensor that is missing, not expected, of another kind, or not finite.
    """
    if tensors.keys() != kinds.keys():
        raise ValueError(f"expected tensors {[*kinds]}, found {[*tensors]}")
    if "D" in sizes:
        sizes["W"] = bits.words_for(sizes["D"])
    found = {}
    for name, kind in kinds.items():
        tensor = tensors[name]
        dtype, *axes = kind.split()
        for letter, size in zip(axes, tensor.shape, strict=False):
            if letter.isalpha():
                sizes.setdefault(letter, max(1, size))
        shape = [sizes[axis] if axis in sizes else int(axis) for axis in axes]
        fits = list(tensor.shape) == shape and str(tensor.dtype) == f"torch.{dtype}"
        if not fits or not tensor.isfinite().all():
            raise ValueError(
                f"{name}: expected {kind}, found {tensor.dtype} {tuple(tensor.shape)}"
            )
        if "W" in axes:
            bits.check_padding(tensor, sizes["D"])
            found[name] = tensor
        else:
            found[name] = tensor.cpu()
    return found


def compact(tensor: Tensor) -> Tensor:
    """A tensor, or a copy where it is a view of more memory, all of which a pickle would hold."""
    if tensor.untyped_storage().nbytes() > tensor.nbytes:
        return tensor.clone()
    return tensor


def prefixed(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors of one part of a model, by the names that they have in its file."""
    return {f"{prefix}.{name}": tensor for name, tensor in tensors.items()}


def without_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """Those of the tensors of a file that are of one part, by their names in that part."""
    start = f"{prefix}."
    own = [name for name in tensors if name.startswith(start)]
    return {name.removeprefix(start): tensors[name] for name in own}


def check_parts(tensors: Mapping[str, Tensor], parts: Collection[str]) -> None:
    """Raise ValueError for a tensor of none of these parts of a model."""
    for name in tensors:
        if name.partition(".")[0] not in parts:
            raise ValueError(f"a tensor {name!r}")
