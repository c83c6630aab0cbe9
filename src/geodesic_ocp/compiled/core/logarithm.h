/* The logarithmic map: the initial velocity of the geodesic of least energy near a given path. */

enum { FOUND = 0, MINIMIZATION = 10, INTEGRATION = 20, STALLED = 21, UNVERIFIED = 22 };
static const double SMALLEST_STEP = 1e-15; /* tolerance of a step */
#define MOST_STEPS 2000 /* of an integration */

typedef struct {
  double step;      /* tolerance of a step of the integration */
  double wanted;    /* endpoint error at which corrections end */
  double accepted;  /* largest endpoint error of a result */
} tolerances;

/* Initial velocity v0 = G^-1 p0 and its derivative by the goal, (N, N), columns first, of the
   minimum that `minimize` found on this grid.

   With the Jacobi fields J = H_ii^-1 H_i0 of the inner nodes, dp0/dq1 = J' H_i1 - H_01. The
   momentum is p0 = -dE(e - J), the derivative of the energy by moving the first node with all
   others following. An error of the path enters it in the second order only, and so it gains by a
   finer quadrature: E is that of the next level, if there is one. */
static void initial_velocity(const level *grid, const level *next, const blas *library,
                             const double *x, workspace *w, double *velocity, double *by_goal) {
  int size = num_nodes(grid) * N, inner = size - 2 * N, c, i, k;
  double momentum[N], column[N];
  for (c = 0; c < N; c++) {
    double *field = w->fields + (long)c * inner;
    for (k = 0; k < inner; k++) field[k] = w->hessian[(long)(N + k) * size + c];
    solve_triangular(library, 1, w->factor, inner, inner, field);
    solve_triangular(library, 0, w->factor, inner, inner, field);
  }
  if (next) {
    int nodes = num_nodes(next), before = num_nodes(grid), segment, a, j;
    double *path = w->finer, *slope = path + (long)nodes * N, *out = w->points;
    double state[2 * N], density;
    const double *arguments[1];
    double *results[2];
    arguments[0] = state;
    results[0] = &density;
    interpolate(next, before, x, path);
    for (segment = 0; segment < next->segments; segment++)
      for (k = 0; k < next->points; k++, out += GRADIENT) {
        state_at(next, path + (long)segment * next->degree * N, k, state);
        results[1] = out;
        energy_gradient(arguments, results, 0, w->casadi, 0);
      }
    gradient_of(next, w->points, GRADIENT, slope);
    memset(w->gradient, 0, sizeof(double) * size);
    for (i = 0; i < nodes; i++)
      for (a = 0; a < before; a++) {
        double weight = next->refine[i * before + a];
        for (j = 0; j < N; j++) w->gradient[a * N + j] += weight * slope[i * N + j];
      }
  } else { /* to first order, that after the last step */
    gradient_of(grid, w->points, POINT_SIZE, w->gradient);
    for (c = 0; c < N; c++)
      for (k = 0; k < inner; k++)
        w->gradient[c] += w->hessian[(long)(N + k) * size + c] * w->step[k];
    memset(w->gradient + N, 0, sizeof(double) * inner);
  }
  for (c = 0; c < N; c++) {
    const double *field = w->fields + (long)c * inner;
    momentum[c] = -w->gradient[c];
    for (k = 0; k < inner; k++) momentum[c] += field[k] * w->gradient[N + k];
  }
  evaluate(metric_solve, x, momentum, velocity, w->casadi);
  for (c = 0; c < N; c++) {
    const double *of_goal = w->hessian + (long)(size - N + c) * size;
    for (i = 0; i < N; i++) {
      const double *field = w->fields + (long)i * inner;
      column[i] = -of_goal[i];
      for (k = 0; k < inner; k++) column[i] += field[k] * of_goal[N + k];
    }
    evaluate(metric_solve, x, column, by_goal + c * N, w->casadi);
  }
}

/* Difference of Exp_q0(v0) from the goal, integrated with the given tolerance of a step: one of the
   answers known, or if they are not complete, the next question, and a failure. */
static int endpoint_error(const double *q0, const double *q1, const double *v0, double tolerance,
                          double *difference, double *largest, workspace *w, statistics *stats) {
  double start[2 * N], states[4 * N], times[2] = {0, 1};
  integration record = {0, 0, 0};
  int i, failure, at = stats->integrations;
  if (w->ahead && at == w->ahead->known && at < MOST_ANSWERS) {
    w->ahead->is_open = 1;
    w->ahead->tolerance = tolerance;
    memcpy(w->ahead->velocity, v0, sizeof(double) * N);
    return TOO_MANY_STEPS;
  }
  if (w->ahead && at < w->ahead->known) {
    failure = w->ahead->failure[at];
    record.steps = w->ahead->steps[at];
    memcpy(difference, w->ahead->difference[at], sizeof(double) * N);
  } else {
    for (i = 0; i < N; i++) {
      start[i] = q0[i];
      start[N + i] = v0[i];
    }
    failure = integrate(geodesic_rate, 2 * N, start, 0, 2, times, tolerance, MOST_STEPS, states,
                        w->casadi, &record);
    for (i = 0; i < N; i++) difference[i] = states[2 * N + i] - q1[i];
  }
  stats->integrations++;
  stats->steps += record.steps;
  *largest = 0;
  for (i = 0; i < N; i++) {
    *largest = fabs(difference[i]) <= *largest ? *largest : fabs(difference[i]);
  }
  return failure;
}

/* Whether the geodesic meets the goal also from v0 changed by a few roundings. Two integrations can
   agree by chance where rounding errors grow beyond the tolerance. */
static int survives_rounding(const double *q0, const double *q1, const tolerances *allowed,
                             const double *v0, double step, workspace *w, statistics *stats) {
  double nearby[N], difference[N], error;
  int sign, i;
  for (sign = -1; sign <= 1; sign += 2) {
    for (i = 0; i < N; i++) nearby[i] = v0[i] * (1 + sign * 4 * 2.2e-16);
    if (endpoint_error(q0, q1, nearby, step, difference, &error, w, stats)) return 0;
    stats->error = fmax(stats->error, error);
    if (!(error <= allowed->accepted)) return 0;
  }
  return 1;
}

/* Correct v0 until the geodesic ends at the goal: Newton's method with Broyden's updates of the
   derivative (N, N) of v0 by the goal.

   The first integrations have a tolerance 30 times as large as the last. Where the last one meets
   the goal after a correction by such a coarser one, the two agree, and the difference bounds the
   error of the coarser. Otherwise a coarser one verifies the result. Where corrections gain nothing
   near the goal, geodesics diverge and the integration's own error may be what remains: it becomes
   finer, and the result has to survive changes by rounding. */
static int correct(const double *q0, const double *q1, const tolerances *allowed, double *v0,
                   double *by_goal, workspace *w, statistics *stats) {
  double difference[N], before[N], change[N], step = allowed->step, last = 1e300, error;
  int round, i, c, is_fine = 0;
  for (round = 0; round < 20; round++) {
    int after_coarse = !is_fine, is_stalled;
    is_fine = last < 1e-5;
    if (endpoint_error(q0, q1, v0, is_fine ? step : 30 * step, difference, &error, w, stats))
      return INTEGRATION;
    if (round == 0) stats->first_error = error;
    stats->error = error;
    is_stalled = !(error < 0.5 * last || error <= allowed->accepted);
    if (is_stalled) {
      if (!(error < 1e-3) || step <= SMALLEST_STEP)
        return error < 1e-6 ? UNVERIFIED : STALLED;
      step = fmax(SMALLEST_STEP, step / 30);
    } else if (round > 0) { /* Broyden's second form, for the inverse */
      double along[N], row[N], product = 0, square = 0;
      for (i = 0; i < N; i++) {
        along[i] = row[i] = 0;
        for (c = 0; c < N; c++) {
          along[i] += by_goal[i + N * c] * (difference[c] - before[c]);
          row[i] += change[c] * by_goal[c + N * i];
        }
        product += change[i] * along[i];
        square += change[i] * change[i];
      }
      if (fabs(product) > 0.1 * square)
        for (i = 0; i < N; i++)
          for (c = 0; c < N; c++) by_goal[i + N * c] += (change[i] - along[i]) * row[c] / product;
    }
    for (i = 0; i < N; i++) {
      change[i] = 0;
      before[i] = difference[i];
      for (c = 0; c < N; c++) change[i] -= by_goal[i + N * c] * difference[c];
      v0[i] += change[i];
    }
    if (is_fine && error <= allowed->accepted &&
        (error <= allowed->wanted || !(error < 0.5 * last))) {
      int is_refined = step < allowed->step;
      if (is_refined && !survives_rounding(q0, q1, allowed, v0, step, w, stats)) return UNVERIFIED;
      if (after_coarse) return FOUND;
      if (endpoint_error(q0, q1, v0, 30 * step, difference, &error, w, stats)) return INTEGRATION;
      stats->error = fmax(stats->error, error / 2);
      if (error / 2 <= allowed->accepted) return FOUND;
      if (step <= SMALLEST_STEP) return UNVERIFIED;
      step = fmax(SMALLEST_STEP, step / 30);
      error = 1e-6;
    }
    last = error;
  }
  return STALLED;
}
