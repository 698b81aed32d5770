"""Tensors of a saved model, by the names of its parts, and checks of their types and shapes."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from torch import Tensor

from hdc import bits

Kinds = Mapping[str, str]
"""Name → type and axes, such as ``"int64 L 4 W"``; a letter is a size, W the words of D bits."""


def checked(
    tensors: Mapping[str, Tensor], kinds: Kinds, **sizes: int
) -> dict[str, Tensor]:
    """Check types and shapes of tensors; all but packed words are moved to the CPU.

    Args:
        tensors: tensors from a file, which may be anything.
        kinds: their expected types and axes.
        sizes: sizes of letters. A letter without a size may have any size above zero, the same in
            all tensors. D is required for words, whose bits beyond D have to be zero.

    Raises:
        ValueError: for a tensor that is missing, not expected, of another type or shape, or not
            finite.
    """
    if tensors.keys() != kinds.keys():
        raise ValueError(f"expected tensors {[*kinds]}, found {[*tensors]}")
    if "D" in sizes:
        sizes["W"] = bits.words_for(sizes["D"])
    return {
        name: _checked(name, tensors[name], kind, sizes) for name, kind in kinds.items()
    }


def _checked(name: str, tensor: Tensor, kind: str, sizes: dict[str, int]) -> Tensor:
    """One of the tensors; sizes of letters that it is the first to have are added to `sizes`."""
    dtype, *axes = kind.split()
    for axis, size in zip(axes, tensor.shape, strict=False):
        sizes.setdefault(axis, int(axis) if axis.isdigit() else max(1, size))
    expected = tuple(sizes.get(axis) for axis in axes)
    fits = tensor.shape == expected and str(tensor.dtype) == f"torch.{dtype}"
    if not fits or not tensor.isfinite().all():
        raise ValueError(
            f"{name}: expected {kind}, found {tensor.dtype} {tuple(tensor.shape)}"
        )
    if "W" not in axes:
        return tensor.cpu()
    bits.check_padding(tensor, sizes["D"])
    return tensor


def compact(tensor: Tensor) -> Tensor:
    """A tensor without unused memory: of a view, a pickle would hold the whole storage."""
    if tensor.untyped_storage().nbytes() > tensor.nbytes:
        return tensor.clone()
    return tensor


def prefixed(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors of a part of a model, by their names in a file."""
    return {f"{prefix}.{name}": tensor for name, tensor in tensors.items()}


def without_prefix(prefix: str, tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors of a part of a model, from a file, by their names in that part."""
    start = f"{prefix}."
    own = [name for name in tensors if name.startswith(start)]
    return {name.removeprefix(start): tensors[name] for name in own}


def check_parts(tensors: Mapping[str, Tensor], parts: Collection[str]) -> None:
    """Raise ValueError for a tensor that belongs to none of these parts."""
    for name in tensors:
        if name.partition(".")[0] not in parts:
            raise ValueError(f"a tensor {name!r}")
