// For MinGW alone, whose GCC makes one call of the sine and the cosine of an angle. The C runtime of Blender and Python
// for Windows has no such function, and MinGW's own rounds differently.
// Compiled with -fno-builtin: otherwise they would call themselves.
#include <math.h>

extern "C" void sincos(double angle, double* sine, double* cosine) {
  *sine = sin(angle);
  *cosine = cos(angle);
}

extern "C" void sincosf(float angle, float* sine, float* cosine) {
  *sine = sinf(angle);
  *cosine = cosf(angle);
}
