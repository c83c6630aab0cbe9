/* Vectors of LANES numbers, on which GCC computes at once where the processor can; elsewhere LANES
   is not defined, and numbers follow one another. Functions of vectors are those of the C library
   libmvec where it is there, and otherwise those of numbers, one lane after the other. */
#if defined(__GNUC__) && !defined(__clang__) && defined(__x86_64__) && defined(__AVX2__)
#ifdef __AVX512F__
#define LANES 8
#define OF_LIBMVEC(f) _ZGVeN8v_##f
#else
#define LANES 4
#define OF_LIBMVEC(f) _ZGVdN4v_##f
#endif
typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef long long mask __attribute__((vector_size(8 * LANES)));
static const lanes zero;

#define EACH_LANE(f)                                                                               \
  static inline lanes lanes_##f(lanes x) {                                                         \
    int l;                                                                                         \
    for (l = 0; l < LANES; l++) x[l] = f(x[l]);                                                    \
    return x;                                                                                      \
  }
#define EACH_LANE_OF_TWO(f)                                                                        \
  static inline lanes lanes_##f(lanes x, lanes y) {                                                \
    int l;                                                                                         \
    for (l = 0; l < LANES; l++) x[l] = f(x[l], y[l]);                                              \
    return x;                                                                                      \
  }
#define AT_ONCE(f)                                                                                 \
  extern lanes OF_LIBMVEC(f)(lanes) __attribute__((weak));                                         \
  static inline lanes lanes_##f(lanes x) {                                                         \
    int l;                                                                                         \
    if (OF_LIBMVEC(f)) return OF_LIBMVEC(f)(x);                                                    \
    for (l = 0; l < LANES; l++) x[l] = f(x[l]);                                                    \
    return x;                                                                                      \
  }
AT_ONCE(sin) AT_ONCE(cos)
EACH_LANE(sqrt) EACH_LANE(exp) EACH_LANE(log) EACH_LANE(tan) EACH_LANE(asin) EACH_LANE(acos)
EACH_LANE(atan) EACH_LANE(sinh) EACH_LANE(cosh) EACH_LANE(tanh) EACH_LANE(fabs)
EACH_LANE_OF_TWO(pow) EACH_LANE_OF_TWO(atan2) EACH_LANE_OF_TWO(fmin) EACH_LANE_OF_TWO(fmax)

static inline lanes lanes_sq(lanes x) { return x * x; }
/* 1 where true, 0 elsewhere */
static inline lanes lanes_true(mask where) { return (lanes)(where & (mask)(zero + 1)); }
/* x where true, 0 elsewhere */
static inline lanes lanes_where(mask where, lanes x) { return (lanes)(where & (mask)x); }
/* The larger of x and y, and y where they cannot be compared. */
static inline lanes larger(lanes x, lanes y) {
  mask first = x > y;
  return (lanes)((first & (mask)x) | (~first & (mask)y));
}
#endif
