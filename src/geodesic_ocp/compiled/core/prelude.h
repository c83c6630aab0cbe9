/* Declarations of the C library's functions that follow: no compiler needs its headers. */
double sin(double); double cos(double); double tan(double);
double asin(double); double acos(double); double atan(double); double atan2(double, double);
double sinh(double); double cosh(double); double tanh(double);
double asinh(double); double acosh(double); double atanh(double);
double sqrt(double); double cbrt(double); double hypot(double, double);
double exp(double); double expm1(double); double log(double); double log1p(double);
double pow(double, double); double fabs(double); double fmod(double, double);
double floor(double); double ceil(double); double fmin(double, double); double fmax(double, double);
double copysign(double, double); double erf(double); double remainder(double, double);
void *memcpy(void *, const void *, unsigned long);
void *memset(void *, int, unsigned long);
#define isnan(x) ((x) != (x))
#define isinf(x) (!isnan(x) && isnan((x) - (x)))
#define NAN (0.0 / 0.0)
#define INFINITY (1.0 / 0.0)
