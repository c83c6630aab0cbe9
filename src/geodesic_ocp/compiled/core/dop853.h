/* Adaptive integration with the method of order 8 of Dormand and Prince (DOP853: Hairer, Norsett,
   Wanner, Solving Ordinary Differential Equations I, 2nd ed., section II.5). The coefficients
   RK_A, RK_B, RK_E5, RK_E3 come from SciPy. */

#define STAGES 12
#define LARGEST_STATE (4 * N)

typedef int (*rate_function)(const double **, double **, casadi_int *, double *, int);

enum { INTEGRATED = 0, TOO_MANY_STEPS = 1, STEP_TOO_SMALL = 2 };

typedef struct {
  double time;      /* reached */
  double step;      /* size of the last one */
  long steps;       /* taken, rejected ones included */
} integration;

/* dy := rate(y), or rate(y, p) */
static void evaluate(rate_function rate, const double *y, const double *p, double *dy,
                     double *work) {
  const double *arguments[2];
  double *results[1];
  arguments[0] = y;
  arguments[1] = p;
  results[0] = dy;
  rate(arguments, results, 0, work, 0);
}

/* Hairer's estimate of the error, from the sums of the squares of two. */
static double step_error(double fifth, double third, int size) {
  if (!(fifth + third < 1e300)) return 1e300;
  if (fifth + third == 0) return 1e-16;
  return fmax(1e-16, fifth / sqrt((fifth + 0.01 * third) * size));
}

/* Size of the step that follows one of size `step` with this error, where h was to be taken: one
   that was shortened to end at a stop does not limit the next. */
static double next_step(double h, double step, double error) {
  double factor = step * fmin(8, fmax(0.2, 0.9 * pow(error, -0.125)));
  return error > 1 || step == h ? factor : fmax(h, factor);
}

/* Slopes at all stages of a step of size h from y, whose slope k[0] is given; the end point, its
   slope k[12] and Hairer's estimate of the error relative to the tolerance. Where p is given, its
   row s, of width np, belongs to stage s, the last to the end of the step. */
static double take_step(rate_function rate, int size, const double *y, const double *p, int np,
                        double h, double tolerance, double k[STAGES + 1][LARGEST_STATE],
                        double *end, double *work) {
  double at[LARGEST_STATE], fifth = 0, third = 0;
  int i, j, s;
  for (s = 1; s < STAGES; s++) {
    for (i = 0; i < size; i++) {
      double sum = 0;
      for (j = 0; j < s; j++) sum += RK_A[s][j] * k[j][i];
      at[i] = y[i] + h * sum;
    }
    evaluate(rate, at, p ? p + s * np : 0, k[s], work);
  }
  for (i = 0; i < size; i++) {
    double sum = 0;
    for (j = 0; j < STAGES; j++) sum += RK_B[j] * k[j][i];
    end[i] = y[i] + h * sum;
  }
  evaluate(rate, end, p ? p + STAGES * np : 0, k[STAGES], work);
  for (i = 0; i < size; i++) {
    double of_fifth = 0, of_third = 0, scale = fmax(1, fmax(fabs(y[i]), fabs(end[i])));
    for (j = 0; j <= STAGES; j++) {
      of_fifth += RK_E5[j] * k[j][i];
      of_third += RK_E3[j] * k[j][i];
    }
    of_fifth *= h / (scale * tolerance);
    of_third *= h / (scale * tolerance);
    fifth += of_fifth * of_fifth;
    third += of_third * of_third;
  }
  return step_error(fifth, third, size);
}

/* Integrate y' = rate(y), or rate(y, p) with constant p, over increasing times; the state at times[i]
   is written to row i. Where it stops early, the first row is the state that it has reached. */
static int integrate(rate_function rate, int size, const double *start, const double *p, int count,
                     const double *times, double tolerance, long max_steps, double *states,
                     double *work, integration *result) {
  double k[STAGES + 1][LARGEST_STATE], y[LARGEST_STATE], end[LARGEST_STATE];
  double interval = times[count - 1] - times[0], h = interval / 8, now = times[0];
  int i, at;
  long taken = 0;
  for (i = 0; i < size; i++) states[i] = y[i] = start[i];
  evaluate(rate, y, p, k[0], work);
  for (at = 1; at < count; at++) {
    while (now < times[at]) {
      int is_last = h >= times[at] - now;
      double step = is_last ? times[at] - now : h, error;
      error = take_step(rate, size, y, p, 0, step, tolerance, k, end, work);
      if (error <= 1) {
        now = is_last ? times[at] : now + step;
        for (i = 0; i < size; i++) {
          y[i] = end[i];
          k[0][i] = k[STAGES][i];
        }
      }
      h = next_step(h, step, error);
      taken++;
      if (taken >= max_steps || h < 1e-13 * interval) {
        for (i = 0; i < size; i++) states[i] = y[i];
        result->time = now;
        result->step = h;
        result->steps += taken;
        return taken >= max_steps ? TOO_MANY_STEPS : STEP_TOO_SMALL;
      }
    }
    for (i = 0; i < size; i++) states[(long)at * size + i] = y[i];
  }
  result->time = now;
  result->step = h;
  result->steps += taken;
  return INTEGRATED;
}
