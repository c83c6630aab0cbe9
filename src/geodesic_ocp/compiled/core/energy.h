/* The discrete energy of a path through the nodes of a grid, its gradient and its Hessian.

   E = sum_k w_k l(q_k, v_k), l = v' G(q) v / 2, at quadrature points k, where q_k = B_k x and
   v_k = D_k x are linear in the positions x of the nodes of their segment. The Hessian's block of
   the nodes a <= b is sum_k w_k (B_a B_b l_qq + B_a D_b l_qv + D_a B_b l_qv' + D_a D_b G). */

typedef struct {
  int segments, degree, points;  /* of equal width; quadrature points in each */
  const double *weights;         /* (points), of one segment */
  const double *values, *slopes; /* (points, degree + 1), rows first: B and D */
  const double *products;        /* 4 x (points, pairs), columns first: w BB, w BD, w DB, w DD */
  const double *refine;          /* (nodes, nodes of the level before), rows first */
  double decrease;               /* relative decrease of the energy by a step that ends the level */
  long max_steps;
} level;

/* Results of one quadrature point: gradient (l_q, l_v), then l_qq, l_qv, G, columns first. */
#define GRADIENT (2 * N)
#define POINT_SIZE (2 * N + 3 * N * N)

static int num_nodes(const level *grid) { return grid->segments * grid->degree + 1; }

/* Position and velocity at quadrature point k of the segment whose first node is x. */
static void state_at(const level *grid, const double *x, int k, double *state) {
  const double *value = grid->values + k * (grid->degree + 1);
  const double *slope = grid->slopes + k * (grid->degree + 1);
  int a, i;
  for (i = 0; i < N; i++) {
    state[i] = x[i];
    state[N + i] = 0;
  }
  for (a = 1; a <= grid->degree; a++) /* relative to the first node: short paths keep digits */
    for (i = 0; i < N; i++) {
      double difference = x[a * N + i] - x[i];
      state[i] += value[a] * difference;
      state[N + i] += slope[a] * difference;
    }
}

#ifdef LANES
typedef int of_lanes(const lanes **, lanes **, casadi_int *, lanes *, int);

/* energy_gradient or energy_hessian, whose size is given, of LANES states, one after the other, of
   which the first `count` are wanted. */
static void densities_of(of_lanes *function, int size, const double *states, int count,
                         double *densities, double *out) {
  lanes given[2 * N], density, results[POINT_SIZE], *both[2];
  const lanes *arguments[1];
  int l, i;
  for (l = 0; l < LANES; l++)
    for (i = 0; i < 2 * N; i++) given[i][l] = states[l * 2 * N + i];
  arguments[0] = given;
  both[0] = &density;
  both[1] = results;
  function(arguments, both, 0, 0, 0);
  memcpy(densities, &density, sizeof(density));
  for (l = 0; l < count; l++)
    for (i = 0; i < size; i++) out[(long)l * size + i] = results[i][l];
}

/* Functions of LANES states as CasADi's: (2 N, LANES) -> densities (1, LANES), and derivatives. */
#define FUNCTION_OF_STATES(name, one, size)                                                        \
  int name(const double **arguments, double **results, long long *iw, double *w, int m) {          \
    double unused[LANES * POINT_SIZE], *first = results[0] ? results[0] : unused;                  \
    densities_of(one, size, arguments[0], results[1] ? LANES : 0, first, results[1]);              \
    return 0;                                                                                      \
  }                                                                                                \
  long long name##_n_in(void) { return 1; }                                                        \
  long long name##_n_out(void) { return 2; }                                                       \
  const long long *name##_sparsity_in(long long i) {                                               \
    static const long long shape[] = {2 * N, LANES, 1};                                            \
    return shape;                                                                                  \
  }                                                                                                \
  const long long *name##_sparsity_out(long long i) {                                              \
    static const long long shapes[][3] = {{1, LANES, 1}, {size, LANES, 1}};                        \
    return shapes[i];                                                                              \
  }
FUNCTION_OF_STATES(energy_gradients, lanes_energy_gradient, GRADIENT)
FUNCTION_OF_STATES(energy_hessians, lanes_energy_hessian, POINT_SIZE)
#endif

/* Energy of the path x (nodes, N); with the derivatives at every point where out is given.
   `added` (N) is a constant diagonal added to G, for continuation. */
static double energy_of(const level *grid, const double *x, const double *added, double *out,
                        double *work) {
  double energy = 0, state[2 * N], density, gradient[GRADIENT];
  int segment, k, i;
#ifdef LANES
  double densities[LANES], states[LANES * 2 * N];
#else
  const double *arguments[1] = {state};
  double *results[2] = {&density};
#endif
  for (segment = 0; segment < grid->segments; segment++)
    for (k = 0; k < grid->points; k++) {
      int at = segment * grid->points + k;
      double *here = out ? out + (long)at * POINT_SIZE : gradient;
      state_at(grid, x + (long)segment * grid->degree * N, k, state);
#ifdef LANES
      if (at % LANES == 0) {
        int last = grid->segments * grid->points - 1, l;
        for (l = 0; l < LANES; l++) {
          int next = at + l < last ? at + l : last, of = next / grid->points;
          state_at(grid, x + (long)of * grid->degree * N, next % grid->points, states + l * 2 * N);
        }
        l = last - at + 1 < LANES ? last - at + 1 : LANES;
        if (out)
          densities_of(lanes_energy_hessian, POINT_SIZE, states, l, densities, here);
        else
          densities_of(lanes_energy_gradient, GRADIENT, states, 0, densities, here);
      }
      density = densities[at % LANES];
#else
      results[1] = here;
      (out ? energy_hessian : energy_gradient)(arguments, results, 0, work, 0);
#endif
      for (i = 0; i < N; i++) density += added[i] * state[N + i] * state[N + i] / 2;
      if (out)
        for (i = 0; i < N; i++) {
          here[N + i] += added[i] * state[N + i];
          here[GRADIENT + 2 * N * N + i * (N + 1)] += added[i];
        }
      energy += grid->weights[k] * density;
    }
  return energy;
}

/* Gradient (nodes, N) from the gradients of the points, rows of the given width apart. */
static void gradient_of(const level *grid, const double *out, int width, double *gradient) {
  int segment, k, a, i;
  memset(gradient, 0, sizeof(double) * num_nodes(grid) * N);
  for (segment = 0; segment < grid->segments; segment++)
    for (k = 0; k < grid->points; k++, out += width)
      for (a = 0; a <= grid->degree; a++) {
        double value = grid->weights[k] * grid->values[k * (grid->degree + 1) + a];
        double slope = grid->weights[k] * grid->slopes[k * (grid->degree + 1) + a];
        double *node = gradient + (long)(segment * grid->degree + a) * N;
        for (i = 0; i < N; i++) node[i] += value * out[i] + slope * out[N + i];
      }
}

/* Upper triangle of the Hessian of all nodes, columns first. `share` in [0, 1] is the share of the
   terms beside G, without which the matrix is positive definite. blocks: 2 N^2 pairs numbers. */
static void hessian_of(const level *grid, const blas *library, const double *out, double share,
                       double *blocks, double *hessian) {
  int nodes = grid->degree + 1, pairs = nodes * (nodes + 1) / 2, points = grid->points;
  int size = num_nodes(grid) * N, segment, a, b, i, j;
  long table = (long)points * pairs;
  double *plain = blocks, *transposed = blocks + (long)N * N * pairs;
  memset(hessian, 0, sizeof(double) * (long)size * size);
  for (segment = 0; segment < grid->segments; segment++) {
    const double *qq = out + (long)segment * points * POINT_SIZE + GRADIENT;
    const double *qv = qq + N * N, *vv = qv + N * N;
    add_product(library, N * N, pairs, points, 1, vv, POINT_SIZE, grid->products + 3 * table, 0,
                plain);
    if (share > 0) {
      add_product(library, N * N, pairs, points, share, qq, POINT_SIZE, grid->products, 1, plain);
      add_product(library, N * N, pairs, points, share, qv, POINT_SIZE, grid->products + table, 1,
                  plain);
      add_product(library, N * N, pairs, points, share, qv, POINT_SIZE,
                  grid->products + 2 * table, 0, transposed);
    } else
      memset(transposed, 0, sizeof(double) * N * N * pairs);
    for (b = 0; b < nodes; b++)
      for (a = 0; a <= b; a++) {
        const double *p = plain + (long)N * N * (b * (b + 1) / 2 + a);
        const double *t = transposed + (long)N * N * (b * (b + 1) / 2 + a);
        double *block = hessian + (long)(segment * grid->degree + b) * N * size +
                        (segment * grid->degree + a) * N;
        for (j = 0; j < N; j++)
          for (i = 0; i < N; i++) block[(long)j * size + i] += p[i + N * j] + t[j + N * i];
      }
  }
}
