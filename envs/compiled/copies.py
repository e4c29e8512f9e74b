"""Copies that share nothing with their originals, whether made by `copy` or by `pickle`.

Both know objects by identity, not by memory: NumPy copies a view as an array of its own, MuJoCo its
data with a model of its own. What shared memory, or held an address of it, would then go on with
that of the original. So arrays and data are handed to them as what stands for them here.
"""

import copy
import pickle
from typing import Any
from weakref import WeakValueDictionary

import mujoco
import numpy as np

FORGOTTEN = ("nl", "solver_niter", "solver_nnz")  # by MuJoCo, when it pickles its data
BUFFERS = (type(None), bytes, bytearray, memoryview, pickle.PickleBuffer)


class Copyable:
    """Base of objects whose copies, shallow ones too, move nothing but themselves.

    What the attributes hold is copied once, so that whatever shares memory here shares it there.
    """

    def __getstate__(self) -> dict[str, Any]:
        return {name: portable(value) for name, value in vars(self).items()}

    def __copy__(self) -> Any:
        return copy.deepcopy(self)


class _Part:
    """An array as a part of the memory that it lies in, with whatever room is around it."""

    def __init__(self, value: np.ndarray):
        self.value = value

    def __reduce__(self) -> tuple[Any, ...]:
        array, owner = self.value, _owner(self.value)
        if owner is array:
            return _whole, (array, array.flags.writeable)
        offset = _address(array) - _address(owner)
        form = array.dtype, array.shape, array.strides, offset
        return _part, (owner, *form, array.flags.writeable)


class _Data:
    """MuJoCo's data, with the copy of its model that all else gets."""

    def __init__(self, value: mujoco.MjData):
        self.value = value

    def __deepcopy__(self, memo: dict[int, Any]) -> mujoco.MjData:
        return _data_of(copy.deepcopy(self.value.model, memo), self.value)

    def __reduce__(self) -> tuple[Any, ...]:
        rest = {name: np.array(getattr(self.value, name)) for name in FORGOTTEN}
        return _unpickled_data, (self.value.model, pickle.dumps(self.value), rest)


#: what stands for an object, by its identity, while it is being copied
_standing_in: WeakValueDictionary[int, Any] = WeakValueDictionary()


def portable(value: Any) -> Any:
    """Return what `copy` and `pickle` can copy `value` from; looks into plain containers."""
    if type(value) is np.ndarray and not value.dtype.hasobject:
        return _stand_in(_Part, value)
    if type(value) is mujoco.MjData:
        return _stand_in(_Data, value)
    if isinstance(value, dict):
        return _unless_same(dict, value, {key: portable(each) for key, each in value.items()})
    if type(value) in (list, tuple):
        return _unless_same(list, value, type(value)(portable(each) for each in value))
    return value


def _stand_in(kind: Any, value: Any) -> Any:
    """The same one for the same object, as long as it is held."""
    known = _standing_in.get(id(value))
    if known is None or known.value is not value:
        known = _standing_in[id(value)] = kind(value)
    return known


def _unless_same(kind: Any, value: Any, replaced: Any) -> Any:
    """`replaced`, or the container itself where nothing in it was replaced."""
    before, after = (each.values() if kind is dict else each for each in (value, replaced))
    return value if all(a is b for a, b in zip(before, after, strict=True)) else replaced


def _owner(array: np.ndarray) -> np.ndarray:
    """The array whose memory this one lies in; itself, where that is no array's."""
    owner, base = array, array.base
    while base is not None and not isinstance(base, BUFFERS):
        if isinstance(base, np.ndarray):
            owner = base
        elif not hasattr(base, "__array_interface__"):
            return array  # memory of MuJoCo
        base = getattr(base, "base", None)
    dense = owner.flags.c_contiguous or owner.flags.f_contiguous
    return owner if dense and not owner.dtype.hasobject and array.size > 0 else array


def _address(array: np.ndarray) -> int:
    return int(array.__array_interface__["data"][0])


def _whole(array: np.ndarray, writeable: bool) -> np.ndarray:
    if not writeable:
        array.flags.writeable = False
    return array


def _part(
    owner: np.ndarray, dtype: Any, shape: Any, strides: Any, offset: int, writeable: bool
) -> np.ndarray:
    memory = owner if owner.flags.c_contiguous else owner.T
    array: np.ndarray = np.ndarray(shape, dtype, memory, offset, strides)
    return _whole(array, writeable)


def _data_of(model: mujoco.MjModel, source: mujoco.MjData) -> mujoco.MjData:
    data = mujoco.MjData(model)
    mujoco.mj_copyData(data, model, source)
    return data


def _unpickled_data(
    model: mujoco.MjModel, pickled: bytes, rest: dict[str, np.ndarray]
) -> mujoco.MjData:
    data = _data_of(model, pickle.loads(pickled))
    for name, value in rest.items():
        if value.ndim == 0:
            setattr(data, name, int(value))
        else:
            getattr(data, name)[:] = value
    return data
