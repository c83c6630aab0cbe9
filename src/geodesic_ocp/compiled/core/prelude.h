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

/* The inverse of erf, which CasADi has and C has not: Winitzki's approximation, then Newton. */
static double erfinv(double x) {
  double l = log(1 - x * x), a = 4.3307508 + l / 2, y;
  int i;
  if (!(fabs(x) < 1)) return x / (1 - fabs(x));
  y = copysign(sqrt(fabs(sqrt(a * a - l / 0.147) - a)), x);
  for (i = 0; i < 4; i++) y -= (erf(y) - x) * 0.886226925452758 * exp(y * y);
  return y;
}
