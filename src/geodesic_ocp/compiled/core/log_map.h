/* From the coarsest level to the finest: minimize, and from level `first` on, correct. */

typedef struct {
  long nodes, width, points; /* largest numbers: of nodes, of a segment's nodes, of points */
} extent;

static extent largest(const level *levels, int count) {
  extent result = {0, 0, 0};
  int i;
  for (i = 0; i < count; i++) {
    long nodes = num_nodes(levels + i), width = levels[i].degree + 1;
    long points = (long)levels[i].segments * levels[i].points;
    if (nodes > result.nodes) result.nodes = nodes;
    if (width > result.width) result.width = width;
    if (points > result.points) result.points = points;
  }
  return result;
}

/* Divide the memory, and return its size; without memory, only that. */
static long divide(const level *levels, int count, double *memory, workspace *w) {
  extent of = largest(levels, count);
  long size = of.nodes * N, at = 0;
  w->points = memory + at, at += of.points * POINT_SIZE;
  w->blocks = memory + at, at += N * N * of.width * (of.width + 1);
  w->hessian = memory + at, at += size * size;
  w->factor = memory + at, at += size * size;
  w->gradient = memory + at, at += size;
  w->step = memory + at, at += size;
  w->trial = memory + at, at += size;
  w->fields = memory + at, at += N * size;
  w->finer = memory + at, at += 2 * size;
  w->casadi = memory + at, at += WORK_SIZE;
  w->ahead = 0;
  return at;
}

/* Size of the memory that `log_map` needs. */
long log_workspace(const level *levels, int count) {
  workspace w;
  return divide(levels, count, 0, &w);
}

/* Minimize on level `at`, from the path x on the level before, or on the first level itself; from
   level `first` on, compute the initial velocity and its derivative by the goal. */
static int descend(const double *q0, const double *q1, const level *levels, int count, int first,
                   int at, const blas *library, double *x, double *share, double *v0,
                   double *by_goal, workspace *w, statistics *stats) {
  const level *grid = levels + at;
  int is_final = at >= first, inner = (num_nodes(grid) - 2) * N, i, failure;
  double none[N];
  for (i = 0; i < N; i++) none[i] = 0;
  stats->level = at;
  if (at > 0) {
    interpolate(grid, num_nodes(grid - 1), x, w->trial);
    memcpy(x, w->trial, sizeof(double) * num_nodes(grid) * N);
    for (i = 0; i < N; i++) {
      x[i] = q0[i];
      x[(num_nodes(grid) - 1) * N + i] = q1[i];
    }
  }
  failure = minimize(grid, library, none, is_final, x, share, w, stats);
  if (failure == CONVERGED) {
    for (i = 0; i < inner; i++) x[N + i] += w->step[i];
    if (is_final)
      initial_velocity(grid, at + 1 < count ? grid + 1 : 0, library, x, w, v0, by_goal);
  }
  return failure;
}

/* `x` holds the path on the first level, at the end that of the last one used. Returns FOUND, or
   why the last level failed. */
int log_map(const double *q0, const double *q1, const level *levels, int count, int first,
            const double *added, int num_added, const tolerances *allowed, const blas *library,
            double *x, double *memory, double *v0, statistics *stats) {
  workspace w;
  int i, at, failure, result = STALLED;
  double share = 1, by_goal[N * N];
  divide(levels, count, memory, &w);
  memset(stats, 0, sizeof(statistics));
  for (i = 0; i < num_added; i++) { /* continuation in a diagonal added to G, on the first level */
    failure = minimize(levels, library, added + i * N, 0, x, &share, &w, stats);
    if (failure > MANY_NEWTON_STEPS) break;
  }
  for (at = 0; at < count; at++) {
    failure = descend(q0, q1, levels, count, first, at, library, x, &share, v0, by_goal, &w, stats);
    if (at < first) continue;
    result = failure ? MINIMIZATION + failure : correct(q0, q1, allowed, v0, by_goal, &w, stats);
    if (result == FOUND) return FOUND;
  }
  return result;
}
