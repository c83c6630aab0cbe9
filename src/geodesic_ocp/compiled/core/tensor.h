/* The metric tensor as numbers, inner products and speeds. */

/* The metric tensor (N, N) at q. */
void tensor_at(const double *q, double *tensor) {
  double work[WORK_SIZE];
  const double *arguments[1];
  double *results[1];
  arguments[0] = q;
  results[0] = tensor;
  metric_tensor(arguments, results, 0, work, 0);
}

static double product(const double *tensor, const double *u, const double *v) {
  double sum = 0;
  int i, j;
  for (j = 0; j < N; j++)
    for (i = 0; i < N; i++) sum += u[i] * tensor[i + N * j] * v[j];
  return sum;
}

/* Speeds |v| (count) of velocities v (count, N) at positions q (count, N). */
void speeds_at(long count, const double *q, const double *v, double *speeds) {
  double tensor[N * N];
  long k;
  for (k = 0; k < count; k++) {
    tensor_at(q + k * N, tensor);
    speeds[k] = sqrt(product(tensor, v + k * N, v + k * N));
  }
}
