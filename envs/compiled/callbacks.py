"""Python functions that compiled code calls by their addresses: rarely, for they take the GIL."""

import ctypes
from collections.abc import Callable
from typing import Any

import llvmlite.ir
from numba.core import types
from numba.extending import intrinsic

_KIND = ctypes.CFUNCTYPE(None)


class CallbackAddress(int):
    """The address of `callback` in this process. A copy of it is that of the copied callback."""

    callback: "Callback"

    def __reduce__(self) -> tuple[Any, ...]:
        if not self:
            return CallbackAddress, (0,)
        return getattr, (self.callback, "address")

    def __copy__(self) -> "CallbackAddress":
        return self


NO_CALLBACK = CallbackAddress(0)  #: stands in a block that calls nothing back


class Callback:
    """`function()`, for `call_back`. Compiled code cannot raise: what it raises waits in `error`.

    It runs in the thread of the caller, which may have released the GIL.
    """

    def __init__(self, function: Callable[[], None]):
        self.function = function
        self.error: BaseException | None = None
        self._address: CallbackAddress | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"function": self.function, "error": self.error, "_address": None}

    @property
    def address(self) -> CallbackAddress:
        """The address that `call_back` takes, of a function that lives as long as this object."""
        if self._address is None:
            self._thunk = _KIND(self._run)
            place = ctypes.cast(self._thunk, ctypes.c_void_p).value
            assert place is not None
            self._address = CallbackAddress(place)
            self._address.callback = self
        return self._address

    def _run(self) -> None:
        try:
            self.function()
        except BaseException as error:  # an interrupt, too: ctypes would print it and go on
            self.error = error

    def check(self) -> None:
        """Raise what the function raised, once."""
        error, self.error = self.error, None
        if error is not None:
            raise error


@intrinsic
def call_back(typing: Any, address: Any) -> Any:
    """Call the Python function of a `Callback` by its address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = llvmlite.ir.FunctionType(llvmlite.ir.VoidType(), [])
        builder.call(builder.inttoptr(args[0], kind.as_pointer()), [])
        return context.get_dummy_value()

    return types.void(address), generate
