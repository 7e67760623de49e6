/* CPython's configuration for 64-bit Windows, as far as its headers ask for it when an extension module is compiled.
   Python's headers are the same on all systems except for this file. The facts are those of CPython's PC/pyconfig.h. */
#ifndef SINEW_PYCONFIG_WINDOWS_H
#define SINEW_PYCONFIG_WINDOWS_H

#include <io.h>

/* The system, and that Python is a DLL. */
#define MS_WIN32
#define MS_WIN64
#define MS_WINDOWS
#define MS_COREDLL
#define NT_THREADS
#define HAVE_DECLSPEC_DLL
#define Py_ENABLE_SHARED 1
#define PLATFORM "win32"

/* Pointers have 64 bits, a long has 32. */
#define SIZEOF_SHORT 2
#define SIZEOF_INT 4
#define SIZEOF_LONG 4
#define SIZEOF_LONG_LONG 8
#define SIZEOF_FLOAT 4
#define SIZEOF_DOUBLE 8
#define SIZEOF_VOID_P 8
#define SIZEOF_SIZE_T 8
#define SIZEOF_OFF_T 4
#define SIZEOF_FPOS_T 8
#define SIZEOF_TIME_T 8
#define SIZEOF_WCHAR_T 2
#define ALIGNOF_LONG 4
#define ALIGNOF_SIZE_T 8
#define ALIGNOF_MAX_ALIGN_T 8

/* The C library. */
#define HAVE_ERRNO_H 1
#define HAVE_STDDEF_H 1
#define HAVE_STDINT_H 1
#define HAVE_SYS_STAT_H 1
#define HAVE_SYS_TYPES_H 1
#define HAVE_WCHAR_H 1
#define STDC_HEADERS 1

#define WITH_DOC_STRINGS 1
#define WITH_PYMALLOC 1

#endif
