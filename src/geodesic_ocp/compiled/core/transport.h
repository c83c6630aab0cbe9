/* Parallel transport along a given curve, whose positions and velocities (2 N) at the stages of
   every step are tabulated. */

/* Transport w (N) over `count` steps of sizes h[]; states has a row after each step, `errors` the
   estimated error of each, relative to the tolerance. p: (count, STAGES + 1, 2 N). */
void transport(long count, const double *h, const double *p, const double *start,
               double tolerance, double *states, double *errors) {
  double k[STAGES + 1][LARGEST_STATE], w[N], end[N], work[WORK_SIZE];
  long step, row = (STAGES + 1) * 2 * N;
  int i;
  for (i = 0; i < N; i++) w[i] = start[i];
  for (step = 0; step < count; step++) {
    evaluate(transport_rate, w, p + step * row, k[0], work);
    errors[step] = take_step(transport_rate, N, w, p + step * row, 2 * N, h[step], tolerance, k,
                             end, work);
    for (i = 0; i < N; i++) states[step * N + i] = w[i] = end[i];
  }
}

/* Matrices of the transport, columns first, at each of `count` positions and velocities (2 N). */
void transport_matrices(long count, const double *states, double *matrices) {
  double work[WORK_SIZE];
  long i;
  for (i = 0; i < count; i++)
    evaluate(transport_matrix, states + i * 2 * N, 0, matrices + i * N * N, work);
}
