"""The cache of compiled kernels: in a folder for everything that decides about their bits.

Numba's own cache tells processors and the file of the function apart. It knows neither the flags of
`fastmath` nor the functions that were compiled into a kernel from other files, and processes that
compile at the same time for different processors may take each other's code for their own. Nor
does it keep two processes from compiling the same kernel, whose last bits may differ.
"""

import contextlib
import fcntl
import hashlib
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
from llvmlite.binding import Linkage
from numba.core.codegen import CPUCodeLibrary
from numba.core.compiler_lock import global_compiler_lock


@contextlib.contextmanager
def kept_in(folder: Path) -> Iterator[None]:
    """Functions that Numba decorates meanwhile keep their machine code in `folder`."""
    before, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(folder)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def compiled_once(dispatcher: Any, folder: Path) -> Any:
    """Numba's `dispatcher`, whose kernels have the same bits in the process that compiles them.

    One process at a time compiles a function; the others wait and read it.
    """
    name = f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"
    lock = folder / f"{hashlib.sha256(name.encode()).hexdigest()}.lock"
    compile_ = dispatcher.compile

    def compile_alone(signature: Any) -> Any:
        with global_compiler_lock, _held(lock), _own_copies():  # threads agree on this order
            return compile_(signature)

    dispatcher.compile = compile_alone
    return dispatcher


@contextlib.contextmanager
def _own_copies() -> Iterator[None]:
    """Meanwhile a kernel that is compiled calls its own copies of the functions that it calls.

    Numba links them as weak symbols, of which a process takes those that it has loaded first. In
    the one that compiles, these are the functions compiled before, each optimized for itself; in
    one that reads the kernel from the cache, the copies within, optimized with their caller. Last
    bits differ.
    """
    finish = CPUCodeLibrary._finalize_final_module

    def finish_alone(library: Any) -> None:
        if library._shared_module is None:  # it was not read from the cache
            module = library._final_module
            library._shared_module = _linkable(module)
            for function in _defined(module, Linkage.linkonce_odr):
                function.linkage = "internal"
        finish(library)

    CPUCodeLibrary._finalize_final_module = finish_alone
    try:
        yield
    finally:
        CPUCodeLibrary._finalize_final_module = finish


def _defined(module: Any, linkage: Linkage) -> list[Any]:
    """The functions that an LLVM module defines with this linkage."""
    return [f for f in module.functions if not f.is_declaration and f.linkage == linkage]


def _linkable(module: Any) -> Any:
    """A copy that can be linked into several others, as `CPUCodeLibrary` makes it."""
    copy = module.clone()
    for function in _defined(copy, Linkage.external):
        function.linkage = "linkonce_odr"
    return copy


_locks: set[Path] = set()  # that this process holds: a kernel may call itself


@contextlib.contextmanager
def _held(path: Path) -> Iterator[None]:
    """Hold a lock, where the file system has such."""
    if path in _locks:
        yield
        return
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
            stack.callback(os.close, file)
            fcntl.flock(file, fcntl.LOCK_EX)
            stack.callback(fcntl.flock, file, fcntl.LOCK_UN)  # a forked process has it open too
        _locks.add(path)
        stack.callback(_locks.discard, path)
        yield
