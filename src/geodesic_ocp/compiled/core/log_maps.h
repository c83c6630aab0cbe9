/* Many logarithmic maps: on each level, paths are minimized one after the other, and geodesics are
   integrated at once. */
#ifdef LANES

typedef struct {
  double velocity[N], by_goal[N * N], share, energy;
  answers known;
} candidate;

/* Size of the memory of `log_maps`. */
long log_maps_workspace(const level *levels, int count, long pairs) {
  return log_workspace(levels, count) +
         (pairs * (sizeof(candidate) + sizeof(arc) + sizeof(long)) + 7) / sizeof(double);
}

/* `correct` for all candidates that are open: again from its start, with one more answer each time. */
static void correct_many(long pairs, const double *q0, const double *q1, const tolerances *allowed,
                         const double *wanted, candidate *all, arc *arcs, long *asked, double *v0,
                         int *found, workspace *w) {
  tolerances own = *allowed;
  long open, p;
  int i;
  do {
    for (open = p = 0; p < pairs; p++) {
      double *v = v0 + p * N, by_goal[N * N];
      answers *known = w->ahead = &all[p].known;
      statistics stats = {0};
      if (!known->is_open) continue;
      known->is_open = 0;
      memcpy(v, all[p].velocity, sizeof(double) * N);
      memcpy(by_goal, all[p].by_goal, sizeof(by_goal));
      own.wanted = wanted[p];
      found[p] = correct(q0 + p * N, q1 + p * N, &own, v, by_goal, w, &stats);
      if (!known->is_open) continue;
      memcpy(arcs[open].start, q0 + p * N, sizeof(double) * N);
      memcpy(arcs[open].start + N, known->velocity, sizeof(double) * N);
      arcs[open].tolerance = known->tolerance;
      asked[open++] = p;
    }
    if (open) integrate_many(open, arcs, MOST_STEPS);
    for (p = 0; p < open; p++) {
      answers *known = &all[asked[p]].known;
      for (i = 0; i < N; i++)
        known->difference[known->known][i] = arcs[p].end[i] - q1[asked[p] * N + i];
      known->steps[known->known] = arcs[p].steps;
      known->failure[known->known++] = arcs[p].failure;
    }
  } while (open);
}

/* Energy relative to that of the shortest path, and distance from another path relative to that of the
   ends, at which a start is given up. */
static const double LONGER = 1.3, SAME_PATH = 0.01;
enum { NEEDLESS = 30 };

/* Give up starts of one pair that do not lead to the shortest geodesic, or lead to the same one as a
   start before: paths on a coarse level tell. */
static void give_up(long starts, const level *grid, const double *x, long size,
                    const candidate *all, int *found) {
  int last = (num_nodes(grid) - 1) * N, i;
  double least = 1e300;
  long p, o;
  for (p = 0; p < starts; p++)
    if (found[p] != NEEDLESS && all[p].energy < least) least = all[p].energy;
  for (p = 0; p < starts; p++) {
    const double *path = x + p * size;
    if (found[p] == NEEDLESS || found[p] == FOUND) continue;
    if (all[p].energy > LONGER * least) found[p] = NEEDLESS;
    for (o = 0; o < p && found[p] != NEEDLESS; o++) {
      double distance = 0, length = 0;
      if (found[o] == NEEDLESS) continue;
      for (i = 0; i <= last + N - 1; i++)
        distance = fmax(distance, fabs(path[i] - x[o * size + i]));
      for (i = 0; i < N; i++) length = fmax(length, fabs(path[last + i] - path[i]));
      if (distance < SAME_PATH * length) found[p] = NEEDLESS;
    }
  }
}

/* q0, q1, v0: (pairs, N). x: (pairs, size), of which each row holds the path on the first level, and
   has space for that on any. wanted: (pairs), the errors at which corrections end. are_starts: all
   pairs are starts of one, whose shortest geodesic is sought. found: (pairs), results of `log_map`,
   or NEEDLESS. */
void log_maps(long pairs, const double *q0, const double *q1, const level *levels, int count,
              int first, const tolerances *allowed, const double *wanted, int are_starts,
              const blas *library, double *x, long size, double *memory, double *v0, int *found) {
  candidate *all = (candidate *)(memory + log_workspace(levels, count));
  arc *arcs = (arc *)(all + pairs);
  workspace w;
  long p;
  int at;
  divide(levels, count, memory, &w);
  for (p = 0; p < pairs; p++) {
    all[p].share = 1;
    found[p] = STALLED;
  }
  for (at = 0; at < count; at++) {
    for (p = 0; p < pairs; p++) {
      int failure;
      statistics stats = {0};
      all[p].known.known = all[p].known.is_open = 0;
      if (found[p] == FOUND || found[p] == NEEDLESS) continue;
      failure = descend(q0 + p * N, q1 + p * N, levels, count, first, at, library, x + p * size,
                        &all[p].share, all[p].velocity, all[p].by_goal, &w, &stats);
      found[p] = MINIMIZATION + failure;
      all[p].energy = stats.energy;
    }
    if (are_starts && at >= first - 1) give_up(pairs, levels + at, x, size, all, found);
    for (p = 0; p < pairs; p++)
      all[p].known.is_open = at >= first && found[p] == MINIMIZATION + CONVERGED;
    correct_many(pairs, q0, q1, allowed, wanted, all, arcs, (long *)(arcs + pairs), v0, found, &w);
  }
}
#endif
