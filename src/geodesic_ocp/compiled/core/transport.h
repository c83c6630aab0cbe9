/* Parallel transport along a given curve. */

/* Matrices of the transport, columns first, at each of `count` positions and velocities (2 N). */
void transport_matrices(long count, const double *states, double *matrices) {
  double work[WORK_SIZE];
  long i;
  for (i = 0; i < count; i++)
    evaluate(transport_matrix, states + i * 2 * N, 0, matrices + i * N * N, work);
}
