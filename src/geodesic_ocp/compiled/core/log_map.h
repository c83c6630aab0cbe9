/* From the coarsest level to the finest: minimise, and from level `first` on, correct. */

long log_workspace(const level *levels, int count) {
  long size = 0, nodes = 0, width = 0, pairs = 0, points = 0;
  int i;
  for (i = 0; i < count; i++) {
    const level *l = levels + i;
    nodes = num_nodes(l) > nodes ? num_nodes(l) : nodes;
    width = l->degree + 1 > width ? l->degree + 1 : width;
    points = l->segments * l->points > points ? l->segments * l->points : points;
  }
  pairs = width * (width + 1) / 2;
  size = nodes * N;
  return points * POINT_SIZE + 2 * N * N * pairs + 2 * size * size + (6 + N) * size + WORK_SIZE;
}

/* `x` holds the path on the first level, at the end that of the last one used. Returns FOUND, or
   why the last level failed. */
int log_map(const double *q0, const double *q1, const level *levels, int count, int first,
            const double *added, int num_added, const tolerances *allowed, const blas *library,
            double *x, double *memory, double *v0, statistics *stats) {
  workspace w;
  int i, at, failure = 0, result = STALLED, before = 0;
  long nodes = 0, width = 0, points = 0, size;
  double share = 1, by_goal[N * N], none[N];
  for (i = 0; i < N; i++) none[i] = 0;
  for (i = 0; i < count; i++) {
    const level *l = levels + i;
    nodes = num_nodes(l) > nodes ? num_nodes(l) : nodes;
    width = l->degree + 1 > width ? l->degree + 1 : width;
    points = l->segments * l->points > points ? l->segments * l->points : points;
  }
  size = nodes * N;
  w.points = memory;
  w.blocks = w.points + points * POINT_SIZE;
  w.hessian = w.blocks + N * N * width * (width + 1);
  w.factor = w.hessian + size * size;
  w.gradient = w.factor + size * size;
  w.step = w.gradient + size;
  w.trial = w.step + size;
  w.fields = w.trial + size;
  w.finer = w.fields + N * size;
  w.casadi = w.finer + 2 * size;
  memset(stats, 0, sizeof(statistics));
  for (i = 0; i < num_added; i++) { /* continuation in a diagonal added to G, on the first level */
    failure = minimize(levels, library, added + i * N, 0, x, &share, &w, stats);
    if (failure > MANY_NEWTON_STEPS) break;
  }
  for (at = 0; at < count; at++) {
    const level *grid = levels + at;
    int is_final = at >= first, inner = (num_nodes(grid) - 2) * N;
    stats->level = at;
    if (at > 0) {
      interpolate(grid, before, x, w.trial);
      memcpy(x, w.trial, sizeof(double) * num_nodes(grid) * N);
      for (i = 0; i < N; i++) {
        x[i] = q0[i];
        x[(num_nodes(grid) - 1) * N + i] = q1[i];
      }
    }
    before = num_nodes(grid);
    failure = minimize(grid, library, none, is_final, x, &share, &w, stats);
    if (failure == CONVERGED)
      for (i = 0; i < inner; i++) x[N + i] += w.step[i];
    if (!is_final) continue;
    if (failure != CONVERGED) {
      result = MINIMIZATION + failure;
      continue;
    }
    initial_velocity(grid, at + 1 < count ? grid + 1 : 0, library, x, &w, v0, by_goal);
    result = correct(q0, q1, allowed, v0, by_goal, &w, stats);
    if (result == FOUND) return FOUND;
  }
  return result;
}
