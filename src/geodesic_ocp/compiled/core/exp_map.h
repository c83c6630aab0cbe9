/* Integration of geodesics, and the exponential map where two integrations agree at once. */

/* The geodesic equation, from the state (q, v) at times[0]. */
int integrate_geodesic(const double *start, int count, const double *times, double tolerance,
                       long max_steps, double *states, integration *result) {
  double work[WORK_SIZE];
  return integrate(geodesic_rate, 2 * N, start, 0, count, times, tolerance, max_steps, states, work,
                   result);
}

/* Exp_q(v) is the first half of the final state (2 N). Nonzero where the metric at q is not certainly
   valid, an integration stops early, half the difference of two integrations, the first with a
   tolerance 30 times as large, exceeds the tolerance, or the speed changes by more than 5 %. */
int exp_map(const double *q, const double *v, double step, double tolerance, double *state) {
  double start[2 * N], states[2][4 * N], tensor[N * N], times[2] = {0, 1}, work[WORK_SIZE], speed, change;
  integration record = {0, 0, 0};
  int i, at;
  if (!is_regular(q)) return 1;
  for (i = 0; i < N; i++) {
    start[i] = q[i];
    start[N + i] = v[i];
  }
  for (at = 0; at < 2; at++)
    if (integrate(geodesic_rate, 2 * N, start, 0, 2, times, at ? step : 30 * step, 20000, states[at],
                  work, &record))
      return 1;
  for (i = 0; i < 2 * N; i++) state[i] = states[1][2 * N + i];
  for (i = 0; i < N; i++)
    if (!(fabs(state[i] - states[0][2 * N + i]) <= 2 * tolerance)) return 1;
  tensor_at(q, tensor);
  speed = product(tensor, v, v);
  tensor_at(state, tensor);
  change = product(tensor, state + N, state + N) - speed;
  return !(fabs(change) <= 0.05 * speed);
}
