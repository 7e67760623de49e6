"""What Windows does with files in another way than other systems. Pure.

On Windows, an open file can be renamed and deleted only if all who have opened it allow that, a folder only if nothing
in it is open, and functions of Python that open files do not allow it. So files that several processes share are opened
here. What another program has open for a moment, such as a virus scanner, is tried again for a while.
"""

import os
import sys
from collections.abc import Callable
from typing import Any

LONGEST = 150  # characters of a path on Windows; temporary names are longer, and by default 259 is the limit


def extended(path: str) -> str:
    r"""Returns a whole path of Windows in the form without that limit: \\?\C:\a or \\?\UNC\server\share\a."""
    if path.startswith(("\\\\?\\", "\\\\.\\")):
        return path
    return f"\\\\?\\UNC\\{path[2:]}" if path.startswith("\\\\") else f"\\\\?\\{path}"


if sys.platform == "win32":
    import ctypes
    import msvcrt
    import threading
    import time
    from ctypes import wintypes
    from errno import EACCES

    PATIENCE = 5.0  # seconds
    DENIED, BUSY = 5, (5, 32, 33, 303, 1224)  # access denied, sharing, locked, being deleted, mapped
    IN_USE = "another program uses it: close it there"
    REFUSED = "it may not be changed, or another program uses it: close it there, or choose another folder"

    READ, WRITE, DELETE, LIST_FOLDER = 0x80000000, 0x40000000, 0x10000, 1
    SHARE_READ_WRITE, SHARE_DELETE = 3, 4
    OPEN_EXISTING, NORMAL, OF_FOLDER = 3, 0x80, 0x02000000
    SET_SPARSE, END_OF_FILE = 0x900C4, 6
    ASK, SYNCHRONIZE, NO_SUCH_PROCESS, STILL_RUNS = 0x1000, 0x100000, 87, 258
    NO_HANDLE = ctypes.c_void_p(-1).value

    kernel = ctypes.WinDLL("kernel32", use_last_error=True)
    HANDLE, DWORD = wintypes.HANDLE, wintypes.DWORD
    kernel.CreateFileW.argtypes = (wintypes.LPCWSTR, DWORD, DWORD, ctypes.c_void_p, DWORD, DWORD, HANDLE)
    kernel.CreateFileW.restype = kernel.OpenProcess.restype = HANDLE
    kernel.CloseHandle.argtypes = (HANDLE,)
    kernel.DeviceIoControl.argtypes = (HANDLE, DWORD, *(ctypes.c_void_p, DWORD) * 2, ctypes.c_void_p, ctypes.c_void_p)
    kernel.SetFileInformationByHandle.argtypes = (HANDLE, ctypes.c_int, ctypes.c_void_p, DWORD)
    kernel.OpenProcess.argtypes = (DWORD, wintypes.BOOL, DWORD)
    kernel.WaitForSingleObject.argtypes = (HANDLE, DWORD)
    seeking = threading.Lock()  # reading and writing begin where the file's one position is

    def native(path: str) -> str:
        """Returns the path as functions of the system take it, however long it is."""
        path = os.fspath(path)
        whole = os.path.abspath(path)
        return path if len(whole) <= LONGEST else extended(whole)

    def _patiently(path: str, function: Callable, *arguments: Any) -> Any:
        """Calls the function again while path seems to be in use. Raises OSError, in the end with advice."""
        end, pause = time.monotonic() + PATIENCE, 0.01
        while True:
            try:
                return function(*arguments)
            except OSError as error:
                if error.winerror not in BUSY:
                    raise
                if time.monotonic() >= end:
                    said = REFUSED if error.winerror == DENIED else IN_USE
                    raise OSError(EACCES, said, path) from error
            time.sleep(pause)
            pause = min(2 * pause, 0.2)

    def _handle(path: str, access: int, share: int, kind: int) -> int:
        handle = kernel.CreateFileW(path, access, share, None, OPEN_EXISTING, kind, None)
        if handle == NO_HANDLE:
            number = ctypes.get_last_error()
            raise OSError(0, ctypes.FormatError(number).strip(), path, number)
        return handle

    def open_file(path: str, flags: int) -> int:
        """Returns the descriptor of an existing file, which others may rename and delete. For `open`, too."""
        access = READ | WRITE if flags & os.O_RDWR else READ
        handle = _patiently(path, _handle, path, access, SHARE_READ_WRITE | SHARE_DELETE, NORMAL)
        return msvcrt.open_osfhandle(handle, flags | os.O_BINARY | os.O_NOINHERIT)

    def pread(file: int, size: int, offset: int) -> bytes:
        with seeking:
            os.lseek(file, offset, os.SEEK_SET)
            return os.read(file, size)

    def pwrite(file: int, data: bytes | memoryview, offset: int) -> int:
        with seeking:
            os.lseek(file, offset, os.SEEK_SET)
            return os.write(file, data)

    def resize(file: int, size: int) -> None:
        """Extends a file by zeros that take no room, where the disk can do that."""
        handle, count, end = msvcrt.get_osfhandle(file), DWORD(), ctypes.c_longlong(size)
        kernel.DeviceIoControl(handle, SET_SPARSE, None, 0, None, 0, ctypes.byref(count), None)
        if not kernel.SetFileInformationByHandle(handle, END_OF_FILE, ctypes.byref(end), ctypes.sizeof(end)):
            raise ctypes.WinError(ctypes.get_last_error())

    def replace(source: str, target: str) -> None:
        """Moves a file in the place of any that is there."""
        try:
            _patiently(target, os.replace, source, target)
        except PermissionError as error:
            if not _is_in_use(source):
                raise
            raise OSError(EACCES, IN_USE, source) from error

    def _is_in_use(path):
        """Whether somebody who has the file open does not allow that it moves."""
        try:
            kernel.CloseHandle(_handle(path, DELETE, SHARE_READ_WRITE | SHARE_DELETE, NORMAL))
        except OSError as error:
            return error.winerror in BUSY
        return False

    def rename_folder(source: str, target: str) -> None:
        """Renames a folder. An empty one may be in its place, as on other systems."""

        def attempt():
            try:
                os.rename(source, target)
            except (FileExistsError, PermissionError):
                if not os.path.isdir(target):
                    raise
                os.rmdir(target)
                os.rename(source, target)

        _patiently(target, attempt)

    def remove_folder(path: str) -> None:
        """Removes an empty folder. Raises OSError."""
        _patiently(path, os.rmdir, path)

    class Folder:
        """An open folder, a context manager: nobody can put another folder in its place meanwhile."""

        def __init__(self, path: str) -> None:
            self._path = path
            self._open = _patiently(path, _handle, path, LIST_FOLDER, SHARE_READ_WRITE, OF_FOLDER)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            kernel.CloseHandle(self._open)

        def open(self, name: str, flags: int) -> int:
            return open_file(os.path.join(self._path, name), flags)

        def move(self, name: str, target: str) -> None:
            """Moves a file out of the folder, in the place of any that is there."""
            replace(os.path.join(self._path, name), target)

        def remove(self, name: str, aside: str) -> None:
            """Removes a file. Its name may remain until all have closed it, so it gets that name outside first."""
            self.move(name, aside)
            _patiently(aside, os.remove, aside)

    def is_alive(process: int) -> bool:
        """Whether a process of this machine runs, as far as can be known."""
        if process >= 2**32:
            return True
        handle = kernel.OpenProcess(ASK | SYNCHRONIZE, False, process)
        if not handle:
            return ctypes.get_last_error() != NO_SUCH_PROCESS
        try:
            return kernel.WaitForSingleObject(handle, 0) == STILL_RUNS  # others may hold one that has ended
        finally:
            kernel.CloseHandle(handle)

else:
    pread, pwrite, resize = os.pread, os.pwrite, os.ftruncate

    def native(path: str) -> str:
        return path

    def open_file(path: str, flags: int) -> int:
        return os.open(path, flags | os.O_CLOEXEC)

    def replace(source: str, target: str) -> None:
        os.replace(source, target)

    def rename_folder(source: str, target: str) -> None:
        os.rename(source, target)

    def remove_folder(path: str) -> None:
        os.rmdir(path)

    class Folder:
        def __init__(self, path: str) -> None:
            self._open = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)

        def __enter__(self):
            return self

        def __exit__(self, *_):
            os.close(self._open)

        def open(self, name: str, flags: int) -> int:
            return os.open(name, flags | os.O_CLOEXEC, dir_fd=self._open)

        def move(self, name: str, target: str) -> None:
            os.replace(name, target, src_dir_fd=self._open)

        def remove(self, name: str, _aside: str) -> None:
            os.unlink(name, dir_fd=self._open)

    def is_alive(process: int) -> bool:
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return False
        except (PermissionError, OverflowError):
            pass
        return True
