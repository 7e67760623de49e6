"""How the C library of the process rounds."""

import ctypes
import hashlib

import numpy as np

ONE = ("sinf", "cosf", "acosf", "asinf", "atanf", "expf", "cbrtf", "sin", "cos", "acos", "cbrt")
TWO = ("atan2f", "powf", "fmodf", "atan2", "pow")
SAMPLES = 2000


def fingerprint():
    """Returns a text that is the same if the functions round in the same way, or None on systems other than Linux."""
    try:
        library = ctypes.CDLL("libm.so.6")
    except OSError:
        return None
    digest = hashlib.sha256()
    numbers = np.random.default_rng(1).uniform(0, 1, (SAMPLES, 2)).tolist()
    for names, count in ((ONE, 1), (TWO, 2)):
        for name in names:
            function = getattr(library, name)
            kind = ctypes.c_float if name.endswith("f") else ctypes.c_double
            function.restype, function.argtypes = kind, [kind] * count
            digest.update(np.array([function(*each[:count]) for each in numbers]).tobytes())
    return digest.hexdigest()
