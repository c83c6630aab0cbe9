/* The metric tensor as numbers, inner products and speeds. */

/* The metric tensor (N, N) at q. */
void tensor_at(const double *q, double *tensor) {
  double work[WORK_SIZE];
  evaluate(metric_tensor, q, 0, tensor, work);
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

/* Whether G(q) is certainly finite, symmetric and positive definite. The smallest eigenvalue of the
   matrix g_ij / sqrt(g_ii g_jj) is at least its determinant divided by e. */
int is_regular(const double *q) {
  double tensor[N * N], largest = 0, least = 1e300, determinant = 1;
  int i, j, k;
  tensor_at(q, tensor);
  for (i = 0; i < N * N; i++) {
    if (!(fabs(tensor[i]) < 1e300)) return 0;
    largest = fmax(largest, fabs(tensor[i]));
  }
  for (i = 0; i < N; i++) {
    least = fmin(least, tensor[i * (N + 1)]);
    for (j = 0; j < i; j++)
      if (!(fabs(tensor[i + N * j] - tensor[j + N * i]) <= 1e-9 * largest)) return 0;
  }
  if (!(least > 1e-20 * largest)) return 0;
  for (j = 0; j < N; j++) { /* Cholesky's factor in the upper triangle */
    double diagonal = tensor[j * (N + 1)], square = diagonal;
    for (i = 0; i < j; i++) {
      double sum = tensor[i + N * j];
      for (k = 0; k < i; k++) sum -= tensor[k + N * i] * tensor[k + N * j];
      tensor[i + N * j] = sum / tensor[i * (N + 1)];
      square -= tensor[i + N * j] * tensor[i + N * j];
    }
    if (!(square > 0)) return 0;
    determinant *= square / diagonal;
    tensor[j * (N + 1)] = sqrt(square);
  }
  return determinant > 1e-10;
}
