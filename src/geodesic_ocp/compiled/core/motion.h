/* The motion of least action int (tau' G^-1 tau + tension^2 q' G q') / 2 dt through knots,
   tau = G q'' + Gamma(q', q').

   A motion of S segments is x = (knot 0, segment 0, knot 1, ..., knot S): of a knot position and
   velocity (2 N), of a segment the coefficients (bubbles, N) of functions that vanish with their
   slopes at its ends. With the cubic Hermite functions of its knots these are the `basis` of a
   segment, as functions of the fraction of its duration. */

typedef struct {
  int bubbles, points;    /* in each segment */
  const double *weights;  /* (points) */
  const double *basis;    /* (3, points, 4 + bubbles): values, first and second derivatives */
  const double *products; /* 9 x (points, pairs), columns first, for H_qq, H_qv, H_qa, H_vv, H_va,
                             H_aa, and for the transposes of H_qv, H_qa and H_va */
  double decrease;        /* relative decrease of the action by a step that ends the level */
  long max_steps;
} motion_level;

enum { MOTION_FOUND = 0, MOTION_STEPS = 1, MOTION_NOT_POSITIVE = 2, MOTION_NO_DECREASE = 3,
       MOTION_NOT_FINITE = 4 };

/* Results at a point: gradient by (q, v, a), then blocks of the Hessian: those of Gauss-Newton, all
   six, and of the rest those before H_vv and H_vv. */
#define MOTION_BLOCKS (3 * N)
#define MOTION_REST (3 * N + 6 * N * N)
#define MOTION_POINT (3 * N + 10 * N * N)
#define NUM_BLOCKS 6

static long motion_size(const motion_level *grid, int segments) {
  return ((long)segments * (2 + grid->bubbles) + 2) * N;
}

/* Exponents of the duration in the blocks' weights, and the blocks of the rest. */
static const int MOTION_POWER[NUM_BLOCKS] = {1, 0, -1, -1, -2, -3};
static const int MOTION_OF_REST[NUM_BLOCKS] = {0, 1, 2, 3, -1, -1};

typedef struct {
  double *points, *blocks, *segment, *band, *gradient, *step, *trial, *casadi;
  double tension; /* squared */
} motion_workspace;

static int has_duration(int a) { return a == 1 || a == 3; }

/* (q, v, a) at point k of a segment of duration T; x are the variables from its first knot on. */
static void motion_state(const motion_level *grid, const double *x, double T, int k, double *state) {
  int width = 4 + grid->bubbles, a, d, i;
  const double *after = x + (2 + grid->bubbles) * N;
  for (i = 0; i < 3 * N; i++) state[i] = i < N ? x[i] : 0;
  for (a = 1; a < width; a++) {
    const double *coefficient = a == 1 ? x + N : a == 2 ? after : a == 3 ? after + N : x + (a - 2) * N;
    double scale = has_duration(a) ? T : 1;
    for (d = 0; d < 3; d++, scale /= T) {
      double value = scale * grid->basis[(d * grid->points + k) * width + a];
      for (i = 0; i < N; i++)
        state[d * N + i] += value * (a == 2 ? coefficient[i] - x[i] : coefficient[i]);
    }
  }
}

/* The action; with the derivatives at every point where out is given. */
static double action_of(const motion_level *grid, int segments, const double *durations,
                        const double *x, double *out, motion_workspace *w) {
  double action = 0, state[3 * N], density;
  int s, k;
  const double *arguments[2];
  double *results[2];
  arguments[0] = state;
  arguments[1] = &w->tension;
  results[0] = &density;
  for (s = 0; s < segments; s++)
    for (k = 0; k < grid->points; k++) {
      motion_state(grid, x + (long)s * (2 + grid->bubbles) * N, durations[s], k, state);
      results[1] = out ? out + (long)(s * grid->points + k) * MOTION_POINT : 0;
      (out ? motion_hessian : motion_cost)(arguments, results, 0, w->casadi, 0);
      action += durations[s] * grid->weights[k] * density;
    }
  return action;
}

/* First variable of the segment's coefficient a, from the segment's first knot on. */
static int variable_of(const motion_level *grid, int a) {
  return a < 2 ? a * N : a < 4 ? (2 + grid->bubbles + a - 2) * N : (a - 2) * N;
}

static void motion_gradient(const motion_level *grid, int segments, const double *durations,
                            const double *out, double *gradient) {
  int width = 4 + grid->bubbles, s, k, a, d, i;
  memset(gradient, 0, sizeof(double) * motion_size(grid, segments));
  for (s = 0; s < segments; s++)
    for (k = 0; k < grid->points; k++, out += MOTION_POINT)
      for (a = 0; a < width; a++) {
        double T = durations[s], scale = T * grid->weights[k] * (has_duration(a) ? T : 1);
        double *entry = gradient + (long)s * (2 + grid->bubbles) * N + variable_of(grid, a);
        for (d = 0; d < 3; d++, scale /= T) {
          double value = scale * grid->basis[(d * grid->points + k) * width + a];
          for (i = 0; i < N; i++) entry[i] += value * out[d * N + i];
        }
      }
}

/* Hessian of one segment, (variables, variables), upper triangle, columns first, in the order of x.
   `share` in [0, 1] is the share of the terms that Gauss-Newton leaves out.
   blocks: (6 points + 2 pairs) N^2 numbers. */
static void motion_segment(const motion_level *grid, const blas *library, double T, const double *out,
                           double share, double *blocks, double *hessian) {
  int width = 4 + grid->bubbles, pairs = width * (width + 1) / 2, points = grid->points;
  int size = width * N, block, k, a, b, i, j;
  double *plain = blocks + (long)NUM_BLOCKS * N * N * points, *transposed = plain + (long)N * N * pairs;
  static const int MIXED[NUM_BLOCKS] = {-1, 6, 7, -1, 8, -1};
  int is_first = 1;
  for (block = 0; block < NUM_BLOCKS; block++) {
    double *here = blocks + (long)block * N * N * points, weight = 1;
    int rest = MOTION_OF_REST[block], power = MOTION_POWER[block];
    for (; power > 0; power--) weight *= T;
    for (; power < 0; power++) weight /= T;
    for (k = 0; k < points; k++) {
      const double *point = out + (long)k * MOTION_POINT;
      const double *gauss = point + MOTION_BLOCKS + block * N * N;
      const double *other = point + MOTION_REST + rest * N * N;
      for (i = 0; i < N * N; i++)
        here[(long)k * N * N + i] = weight * (gauss[i] + (rest < 0 ? 0 : share * other[i]));
    }
    add_product(library, N * N, pairs, points, 1, here, N * N,
                grid->products + (long)block * points * pairs, block > 0, plain);
    if (MIXED[block] < 0) continue;
    add_product(library, N * N, pairs, points, 1, here, N * N,
                grid->products + (long)MIXED[block] * points * pairs, !is_first, transposed);
    is_first = 0;
  }
  for (b = 0; b < width; b++)
    for (a = 0; a <= b; a++) {
      const double *p = plain + (long)N * N * (b * (b + 1) / 2 + a);
      const double *t = transposed + (long)N * N * (b * (b + 1) / 2 + a);
      int row = variable_of(grid, a), column = variable_of(grid, b);
      double scale = (has_duration(a) ? T : 1) * (has_duration(b) ? T : 1);
      for (j = 0; j < N; j++)
        for (i = 0; i < N; i++) {
          double value = scale * (p[i + N * j] + t[j + N * i]);
          if (row <= column)
            hessian[(long)(column + j) * size + row + i] = value;
          else
            hessian[(long)(row + i) * size + column + j] = value;
        }
    }
}

/* Banded Hessian, upper triangle, of the free variables; the others have unit rows. */
static void motion_band(const motion_level *grid, const blas *library, int segments,
                        const double *durations, const char *is_free, double share,
                        motion_workspace *w) {
  int size = (4 + grid->bubbles) * N, s, i, j;
  long total = motion_size(grid, segments), column;
  memset(w->band, 0, sizeof(double) * total * size);
  for (s = 0; s < segments; s++) {
    long first = (long)s * (2 + grid->bubbles) * N;
    motion_segment(grid, library, durations[s], w->points + (long)s * grid->points * MOTION_POINT,
                   share, w->blocks, w->segment);
    for (j = 0; j < size; j++)
      for (i = 0; i <= j; i++)
        if (is_free[first + i] && is_free[first + j])
          w->band[(first + j) * size + size - 1 + i - j] += w->segment[(long)j * size + i];
  }
  for (column = 0; column < total; column++)
    if (!is_free[column]) w->band[column * size + size - 1] = 1;
}

static int motion_factor(const motion_level *grid, const blas *library, int segments,
                         const double *durations, const char *is_free, double *share,
                         motion_workspace *w) {
  char upper = 'U';
  int size = (4 + grid->bubbles) * N, total = (int)motion_size(grid, segments), kd = size - 1, info;
  *share = *share == 0 ? 0.25 : fmin(1, 2 * *share);
  for (;;) {
    motion_band(grid, library, segments, durations, is_free, *share, w);
    library->pbtrf(&upper, &total, &kd, w->band, &size, &info);
    if (!info) return 0;
    if (*share == 0) return MOTION_NOT_POSITIVE;
    *share = *share > 0.6 ? 0.4 : *share > 0.3 ? 0.15 : 0;
  }
}

/* Newton's method over the free variables of x. It ends where the step would decrease the action by
   less than the level's fraction, or than rounding, as the least action may vanish; on the last level
   only with the full Hessian positive definite. */
static int motion_minimize(const motion_level *grid, const blas *library, int segments,
                           const double *durations, const char *is_free, int is_last,
                           double rounding, double *x, double *share, double *action,
                           motion_workspace *w, long *steps) {
  char upper = 'U';
  int size = (4 + grid->bubbles) * N, total = (int)motion_size(grid, segments), kd = size - 1;
  int one = 1, info, halvings, i, failure;
  long iteration;
  double now = action_of(grid, segments, durations, x, w->points, w);
  for (iteration = 0; iteration < grid->max_steps; iteration++) {
    double decrement = 0, length = 1, tried = 0;
    motion_gradient(grid, segments, durations, w->points, w->gradient);
    if ((failure = motion_factor(grid, library, segments, durations, is_free, share, w)))
      return failure;
    for (i = 0; i < total; i++) w->step[i] = is_free[i] ? -w->gradient[i] : 0;
    library->pbtrs(&upper, &total, &kd, &one, w->band, &size, w->step, &total, &info);
    for (i = 0; i < total; i++) decrement -= w->step[i] * (is_free[i] ? w->gradient[i] : 0);
    ++*steps;
    *action = now;
    if (!(decrement < 1e300 && now < 1e300)) return MOTION_NOT_FINITE;
    if (decrement <= grid->decrease * now + rounding && (*share == 1 || !is_last)) {
      for (i = 0; i < total; i++) x[i] += w->step[i];
      return MOTION_FOUND;
    }
    for (halvings = 0;; halvings++) {
      if (halvings == 14) return MOTION_NO_DECREASE;
      for (i = 0; i < total; i++) w->trial[i] = x[i] + length * w->step[i];
      tried = action_of(grid, segments, durations, w->trial, halvings ? 0 : w->points, w);
      if (tried <= now - 1e-4 * length * decrement + 1e-13 * now + rounding) break;
      length *= 0.4;
    }
    memcpy(x, w->trial, sizeof(double) * total);
    now = halvings ? action_of(grid, segments, durations, x, w->points, w) : tried;
  }
  return MOTION_STEPS;
}

/* Divide the memory, and return its size; without memory, only that. */
static long motion_divide(const motion_level *levels, int count, int segments, double *memory,
                          motion_workspace *w) {
  double **parts[8];
  long sizes[8] = {0}, total = 0;
  int i, l;
  for (l = 0; l < count; l++) {
    long width = 4 + levels[l].bubbles, points = levels[l].points, all = motion_size(levels + l, segments);
    long needed[8] = {segments * points * MOTION_POINT,
                      N * N * (NUM_BLOCKS * points + width * (width + 1)),
                      width * width * N * N, all * width * N, all, all, all, WORK_SIZE};
    for (i = 0; i < 8; i++) sizes[i] = needed[i] > sizes[i] ? needed[i] : sizes[i];
  }
  parts[0] = &w->points; parts[1] = &w->blocks; parts[2] = &w->segment; parts[3] = &w->band;
  parts[4] = &w->gradient; parts[5] = &w->step; parts[6] = &w->trial; parts[7] = &w->casadi;
  for (i = 0; i < 8; i++) {
    if (memory) *parts[i] = memory + total;
    total += sizes[i];
  }
  return total;
}

long motion_memory(const motion_level *levels, int count, int segments) {
  motion_workspace w;
  return motion_divide(levels, count, segments, 0, &w);
}

/* The coefficients of a level for one with more functions: these begin at zero. */
static void motion_refine(const motion_level *from, const motion_level *to, int segments,
                          const double *x, double *refined) {
  int s, i, width = (2 + from->bubbles) * N, wider = (2 + to->bubbles) * N;
  for (s = 0; s < segments; s++)
    for (i = 0; i < wider; i++)
      refined[(long)s * wider + i] = i < width ? x[(long)s * width + i] : 0;
  for (i = 0; i < 2 * N; i++) refined[(long)segments * wider + i] = x[(long)segments * width + i];
}

/* Condense each segment to its knots: the gradient (segments, 4 N) of its action by their positions
   and velocities, corrected to first order, and its Hessian (segments, 4 N, 4 N), full. */
static int motion_condense(const motion_level *grid, const blas *library, int segments,
                           const double *durations, const double *x, double *gradients,
                           double *hessians, motion_workspace *w) {
  char upper = 'U';
  int width = 4 + grid->bubbles, size = width * N, inner = grid->bubbles * N, s, i, j, k, info;
  action_of(grid, segments, durations, x, w->points, w);
  for (s = 0; s < segments; s++) {
    double *out = w->points + (long)s * grid->points * MOTION_POINT, *h = w->segment;
    double *fields = w->band, *local = w->trial;
    motion_gradient(grid, 1, durations + s, out, local);
    motion_segment(grid, library, durations[s], out, 1, w->blocks, h);
    for (i = 0; i < 4 * N; i++) { /* columns H_bi of the knots, and the gradient by the bubbles */
      int column = i < 2 * N ? i : i + inner;
      for (k = 0; k < inner; k++) {
        int row = 2 * N + k;
        fields[(long)i * inner + k] = row <= column ? h[(long)column * size + row]
                                                    : h[(long)row * size + column];
      }
    }
    for (j = 0; j < inner; j++)
      memcpy(w->band + (long)(4 * N + j) * inner, h + (long)(2 * N + j) * size + 2 * N,
             sizeof(double) * inner);
    library->potrf(&upper, &inner, w->band + (long)4 * N * inner, &inner, &info);
    if (info) return MOTION_NOT_POSITIVE;
    for (i = 0; i < 4 * N; i++)
      solve_triangular(library, 1, w->band + (long)4 * N * inner, inner, inner,
                       fields + (long)i * inner);
    memcpy(w->step, local + 2 * N, sizeof(double) * inner);
    solve_triangular(library, 1, w->band + (long)4 * N * inner, inner, inner, w->step);
    for (i = 0; i < 4 * N; i++) {
      int row = i < 2 * N ? i : i + inner;
      double sum = local[row];
      for (k = 0; k < inner; k++) sum -= fields[(long)i * inner + k] * w->step[k];
      gradients[s * 4 * N + i] = sum;
      for (j = 0; j <= i; j++) {
        int other = j < 2 * N ? j : j + inner;
        double entry = h[(long)row * size + other];
        for (k = 0; k < inner; k++)
          entry -= fields[(long)i * inner + k] * fields[(long)j * inner + k];
        hessians[(long)s * 16 * N * N + i * 4 * N + j] = entry;
        hessians[(long)s * 16 * N * N + j * 4 * N + i] = entry;
      }
    }
  }
  return MOTION_FOUND;
}

/* Minimize on all levels, from knots and coefficients x of the first, which is replaced by that of
   the last level; then condense. is_free is of the variables of the knots (knots, 2 N). */
int find_motion(const blas *library, const motion_level *levels, int count, int segments,
                const double *durations, double tension, double rounding, const char *knots,
                double *memory, char *flags, double *x, double *action, double *gradients,
                double *hessians, long *steps) {
  motion_workspace w;
  double share = 1;
  int l, failure;
  long i;
  motion_divide(levels, count, segments, memory, &w);
  w.tension = tension * tension;
  for (l = 0; l < count; l++) {
    int width = (2 + levels[l].bubbles) * N;
    long total = motion_size(levels + l, segments);
    if (l) {
      motion_refine(levels + l - 1, levels + l, segments, x, w.trial);
      memcpy(x, w.trial, sizeof(double) * total);
    }
    for (i = 0; i < total; i++)
      flags[i] = i % width < 2 * N ? knots[i / width * 2 * N + i % width] : 1;
    if ((failure = motion_minimize(levels + l, library, segments, durations, flags, l == count - 1,
                                   rounding, x, &share, action, &w, steps)))
      return failure + 10 * l;
  }
  return motion_condense(levels + count - 1, library, segments, durations, x, gradients, hessians, &w);
}

/* Hamilton's equations of the motion from the state (q, v, p, r), p and r the momenta of q and v. */
int integrate_motion(const double *start, double tension, int count, const double *times,
                     double tolerance, long max_steps, double *states, integration *result) {
  double work[WORK_SIZE], squared = tension * tension;
  return integrate(motion_rate, 4 * N, start, &squared, count, times, tolerance, max_steps, states,
                   work, result);
}
