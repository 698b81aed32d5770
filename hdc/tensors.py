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
