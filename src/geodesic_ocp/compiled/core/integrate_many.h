/* Integration of many geodesics, LANES at once: each lane has a time and a step of its own, and takes
   the next geodesic when one has ended, so that all are integrated as by `integrate`. */
#ifdef LANES

typedef struct {
  double start[2 * N], tolerance;
  double end[2 * N]; /* at time 1, or where it stopped */
  long steps;
  int failure;
} arc;

static void lanes_rate(const lanes *y, lanes *dy) {
  const lanes *arguments[1];
  lanes *results[1];
  arguments[0] = y;
  results[0] = dy;
  lanes_geodesic_rate(arguments, results, 0, 0, 0);
}

/* As `take_step`: the end point and its slope k[STAGES], and the errors relative to the tolerance. */
static void take_steps(const lanes *y, lanes h, lanes tolerance, lanes k[STAGES + 1][2 * N],
                       lanes *end, double *errors) {
  lanes at[2 * N], fifth = zero, third = zero;
  int i, j, s, l;
  for (s = 1; s <= STAGES; s++) {
    const double *row = s < STAGES ? RK_A[s] : RK_B;
    lanes *to = s < STAGES ? at : end;
    for (i = 0; i < 2 * N; i++) {
      lanes sum = zero;
      for (j = 0; j < s; j++)
        if (row[j] != 0) sum += row[j] * k[j][i];
      to[i] = y[i] + h * sum;
    }
    lanes_rate(to, k[s]);
  }
  for (i = 0; i < 2 * N; i++) {
    lanes of_fifth = zero, of_third = zero, scale;
    scale = larger(zero + 1, larger(larger(y[i], -y[i]), larger(end[i], -end[i])));
    for (j = 0; j <= STAGES; j++) {
      of_fifth += RK_E5[j] * k[j][i];
      of_third += RK_E3[j] * k[j][i];
    }
    of_fifth *= h / (scale * tolerance);
    of_third *= h / (scale * tolerance);
    fifth += of_fifth * of_fifth;
    third += of_third * of_third;
  }
  for (l = 0; l < LANES; l++) errors[l] = step_error(fifth[l], third[l], 2 * N);
}

static void integrate_many(long count, arc *arcs, long max_steps) {
  lanes k[STAGES + 1][2 * N], y[2 * N], end[2 * N], h = zero + 1, tolerance = zero + 1, steps;
  double now[LANES], errors[LANES];
  arc *of[LANES], *next = arcs, *last = arcs + count;
  int i, l, active = 0;
  for (i = 0; i < 2 * N; i++) y[i] = zero + arcs->start[i]; /* idle lanes have to compute, too */
  for (l = 0; l < LANES; l++) of[l] = 0;
  do {
    int is_new = 0;
    for (l = 0; l < LANES; l++) {
      if (of[l] || next == last) continue;
      for (i = 0; i < 2 * N; i++) y[i][l] = next->start[i];
      tolerance[l] = next->tolerance;
      h[l] = 1.0 / 8;
      now[l] = 0;
      next->steps = 0;
      of[l] = next++;
      active++;
      is_new = 1;
    }
    if (is_new) lanes_rate(y, k[0]);
    for (l = 0; l < LANES; l++) steps[l] = of[l] ? fmin(h[l], 1 - now[l]) : 0;
    take_steps(y, steps, tolerance, k, end, errors);
    for (l = 0; l < LANES; l++) {
      int is_last = h[l] >= 1 - now[l], accepted = errors[l] <= 1;
      if (!of[l]) continue;
      if (accepted) {
        now[l] = is_last ? 1 : now[l] + steps[l];
        for (i = 0; i < 2 * N; i++) {
          y[i][l] = end[i][l];
          k[0][i][l] = k[STAGES][i][l];
        }
      }
      h[l] = next_step(h[l], steps[l], errors[l]);
      of[l]->steps++;
      of[l]->failure = of[l]->steps >= max_steps ? TOO_MANY_STEPS
                       : h[l] < 1e-13            ? STEP_TOO_SMALL
                                                 : INTEGRATED;
      if (of[l]->failure || now[l] == 1) {
        for (i = 0; i < 2 * N; i++) of[l]->end[i] = y[i][l];
        of[l] = 0;
        active--;
      }
    }
  } while (active || next < last);
}
#endif
