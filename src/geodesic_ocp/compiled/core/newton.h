/* Newton's method on the discrete energy with fixed ends. */

/* Relative decrease of the energy by a step that is rounding. */
#define STATIONARY 1e-20

enum { CONVERGED = 0, MANY_NEWTON_STEPS = 1, NOT_POSITIVE = 2, NO_DECREASE = 3, NOT_FINITE = 4 };

/* Integrations of one geodesic after another that have been carried out ahead, by `log_maps`. */
#define MOST_ANSWERS 12
typedef struct {
  int known, is_open; /* number of answers; whether one more was asked for */
  double velocity[N], tolerance;        /* of the question */
  double difference[MOST_ANSWERS][N];
  long steps[MOST_ANSWERS];
  int failure[MOST_ANSWERS];
} answers;

typedef struct {
  double *points;    /* derivatives at the quadrature points */
  double *blocks;    /* of the Hessian */
  double *hessian;   /* of all nodes, upper triangle */
  double *factor;    /* of the inner nodes' Hessian */
  double *gradient;  /* of all nodes */
  double *step;      /* of the inner nodes; at the end the last one, not yet taken */
  double *trial;     /* path */
  double *fields;    /* (N, inner): H_ii^-1 H_i0, Jacobi fields that vanish at the goal */
  double *finer;     /* path on the next level, and its gradient */
  double *casadi;    /* work vector of the generated functions */
  answers *ahead;    /* or 0 */
} workspace;

typedef struct {
  long newton_steps, integrations, steps;
  long level;     /* on which it ended */
  double energy;  /* discrete, of the last level */
  double first_error, error; /* endpoint errors of the first and the last integration */
} statistics;

/* Factor the Hessian of the inner nodes, with as much of the terms beside G as keeps it positive
   definite; the search starts above the share of the last step. */
static int factor_inner(const level *grid, const blas *library, double *share, workspace *w) {
  int size = num_nodes(grid) * N, inner = size - 2 * N, j;
  *share = *share == 0 ? 0.25 : fmin(1, 2 * *share);
  for (;;) {
    hessian_of(grid, library, w->points, *share, w->blocks, w->hessian);
    for (j = 0; j < inner; j++)
      memcpy(w->factor + (long)j * inner, w->hessian + (long)(j + N) * size + N,
             sizeof(double) * (j + 1));
    if (!cholesky(library, w->factor, inner, grid->degree * N, N)) return 0;
    if (*share == 0) return NOT_POSITIVE;
    *share = *share > 0.6 ? 0.4 : *share > 0.3 ? 0.15 : 0;
  }
}

/* Minimize over the inner nodes of x (nodes, N). It ends where the step would decrease the energy
   by less than the level's fraction: with is_final only where the full Hessian is positive
   definite, so that the path is a minimum, or where the path is stationary up to rounding, as a
   symmetric one may be that is no minimum. w->step is then left to be taken. */
static int minimize(const level *grid, const blas *library, const double *added, int is_final,
                    double *x, double *share, workspace *w, statistics *stats) {
  int size = num_nodes(grid) * N, inner = size - 2 * N, i, halvings, failure;
  long iteration;
  double energy = energy_of(grid, x, added, w->points, w->casadi);
  for (iteration = 0; iteration < grid->max_steps; iteration++) {
    double decrement = 0, length = 1, tried = 0;
    gradient_of(grid, w->points, POINT_SIZE, w->gradient);
    if ((failure = factor_inner(grid, library, share, w))) return failure;
    for (i = 0; i < inner; i++) w->step[i] = -w->gradient[N + i];
    solve_triangular(library, 1, w->factor, inner, inner, w->step);
    for (i = 0; i < inner; i++) decrement += w->step[i] * w->step[i];
    solve_triangular(library, 0, w->factor, inner, inner, w->step);
    stats->newton_steps++;
    stats->energy = energy;
    if (!(decrement >= 0 && energy < 1e300)) return NOT_FINITE;
    if (decrement <= grid->decrease * energy && (*share == 1 || !is_final)) return CONVERGED;
    if (decrement <= STATIONARY * energy) return CONVERGED;
    for (halvings = 0;; halvings++) {
      if (halvings == 12) return NO_DECREASE;
      memcpy(w->trial, x, sizeof(double) * size);
      for (i = 0; i < inner; i++) w->trial[N + i] += length * w->step[i];
      tried = energy_of(grid, w->trial, added, halvings ? 0 : w->points, w->casadi);
      if (tried <= energy - 1e-4 * length * decrement + 1e-13 * energy) break;
      length *= 0.4;
    }
    memcpy(x, w->trial, sizeof(double) * size);
    energy = halvings ? energy_of(grid, x, added, w->points, w->casadi) : tried;
  }
  memset(w->step, 0, sizeof(double) * inner);
  return MANY_NEWTON_STEPS;
}

/* The path x of the level before, interpolated to the nodes of this grid. */
static void interpolate(const level *grid, int nodes_before, const double *x, double *refined) {
  int nodes = num_nodes(grid), i, j, k;
  for (i = 0; i < nodes; i++)
    for (j = 0; j < N; j++) {
      double sum = 0;
      for (k = 0; k < nodes_before; k++) sum += grid->refine[i * nodes_before + k] * x[k * N + j];
      refined[i * N + j] = sum;
    }
}
