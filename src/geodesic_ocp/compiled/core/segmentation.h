/* Segmentation of a sampled motion: the same rule as in synergies/segment.py. */

/* One step of the classical method of order 4, from curve points p[0] to p[2] over h. */
static void transport_step(double h, const double *p, double *w, double *work) {
  double k1[N], k2[N], k3[N], k4[N], at[N];
  int i;
  evaluate(transport_rate, w, p, k1, work);
  for (i = 0; i < N; i++) at[i] = w[i] + h / 2 * k1[i];
  evaluate(transport_rate, at, p + 2 * N, k2, work);
  for (i = 0; i < N; i++) at[i] = w[i] + h / 2 * k2[i];
  evaluate(transport_rate, at, p + 2 * N, k3, work);
  for (i = 0; i < N; i++) at[i] = w[i] + h * k3[i];
  evaluate(transport_rate, at, p + 4 * N, k4, work);
  for (i = 0; i < N; i++) w[i] += h / 6 * (k1[i] + 2 * k2[i] + 2 * k3[i] + k4[i]);
}

/* Cut where the angle between the transported and the observed velocity exceeds the threshold.

   curve: positions and velocities (2 N) at the samples and at 2 * substeps - 1 equidistant times
   between each and the next; velocity: (samples, N); state of a sample: 0 moves, 1 at
   rest, 2 in a long rest. cuts has a flag for each sample. `change` is the largest relative change
   of the transported vector's norm over one interval, which would be zero without errors, or NaN;
   that interval ends at the sample `worst`. */
void segment_motion(long samples, const double *time, const double *curve, long substeps,
                      const double *velocity, const unsigned char *state, double threshold,
                    unsigned char *cuts, double *change, long *worst) {
  double work[WORK_SIZE], tensor[N * N], w[N], norm = 0;
  long k, part, row = 2 * substeps * 2 * N;
  int i, has_vector = 0;
  *change = 0;
  *worst = 0;
  cuts[0] = cuts[samples - 1] = 1;
  for (k = 0; k < samples; k++) {
    const double *v = velocity + k * N;
    if (state[k] == 2) {
      if (k == 0 || state[k - 1] != 2) cuts[k] = 1;
      has_vector = 0;
      continue;
    }
    tensor_at(curve + k * row, tensor);
    if (k > 0 && state[k - 1] == 2) cuts[k] = 1;
    else if (has_vector) {
      double h = (time[k] - time[k - 1]) / substeps, relative, now;
      for (part = 0; part < substeps; part++)
        transport_step(h, curve + (k - 1) * row + part * 4 * N, w, work);
      now = sqrt(product(tensor, w, w));
      relative = fabs(now - norm) / norm;
      if (!(relative <= *change) && *change == *change) {
        *change = relative;
        *worst = k;
      }
      norm = now;
    }
    if (state[k] == 1) continue;
    if (has_vector) {
      double speed = sqrt(product(tensor, v, v)), sum[N], difference[N];
      for (i = 0; i < N; i++) {
        sum[i] = w[i] / norm + v[i] / speed;
        difference[i] = w[i] / norm - v[i] / speed;
      }
      if (2 * atan2(sqrt(product(tensor, difference, difference)),
                    sqrt(product(tensor, sum, sum))) > threshold) {
        cuts[k] = 1;
        has_vector = 0;
      }
    }
    if (!has_vector) {
      for (i = 0; i < N; i++) w[i] = v[i];
      norm = sqrt(product(tensor, w, w));
      has_vector = 1;
    }
  }
}
