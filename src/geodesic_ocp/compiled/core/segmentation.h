/* Segmentation of an observed curve: the same rule as in
   synergies/segmentation/cuts_by_transport.py. */

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

static double angle_between(const double *tensor, const double *u, const double *v) {
  double of_u = sqrt(product(tensor, u, u)), of_v = sqrt(product(tensor, v, v));
  double sum[N], difference[N];
  int i;
  for (i = 0; i < N; i++) {
    sum[i] = u[i] / of_u + v[i] / of_v;
    difference[i] = u[i] / of_u - v[i] / of_v;
  }
  return 2 * atan2(sqrt(product(tensor, difference, difference)),
                   sqrt(product(tensor, sum, sum)));
}

/* An observed curve: positions and their derivatives (2 N) at its times and halfway between each
   and the next, velocities (N) at its times; the state of a time is 0 moving, 1 at rest, 2 in a
   long rest. */
struct observed {
  const double *time, *curve, *velocity;
  const unsigned char *state;
};

/* Largest relative change of a transported vector's norm over one step, and that step's end. */
struct transport_error {
  double change;
  long at;
};

static const double *point_of(const struct observed *motion, long i) {
  return motion->curve + i * 4 * N;
}

/* Angle by which the velocity turns from point i - 1 to i. */
static double turn_before(const struct observed *motion, long i, double *work) {
  double tensor[N * N], w[N];
  int j;
  for (j = 0; j < N; j++) w[j] = motion->velocity[(i - 1) * N + j];
  transport_step(motion->time[i] - motion->time[i - 1], point_of(motion, i - 1), w, work);
  tensor_at(point_of(motion, i), tensor);
  return angle_between(tensor, w, motion->velocity + i * N);
}

/* The moving point of [first, stop) where the velocity turns most slowly, of those until `until`,
   or the first moving point if there is none before; -1 if nothing moves. */
static long steadiest(const struct observed *motion, long start, long first, long stop,
                      double until, double *work) {
  const double *time = motion->time;
  double least = 0, after = 0;
  long i, found = -1, known = -1;
  for (i = first; i < stop && (found < 0 || time[i] <= until); i++) {
    double turn, over;
    if (motion->state[i]) continue;
    turn = i == start ? 0 : known == i ? after : turn_before(motion, i, work);
    over = time[i + 1] - time[i == start ? i : i - 1];
    after = turn_before(motion, i + 1, work);
    known = i + 1;
    turn = (turn + after) / over;
    if (!(turn < 1e300)) turn = 1e300; /* next to a velocity of zero */
    if (found < 0 || turn < least) {
      least = turn;
      found = i;
    }
  }
  return found;
}

/* Cuts within [start, stop), a stretch between long rests, appended to `cuts`. */
static long cut_stretch(const struct observed *motion, long start, long stop, double threshold,
                        double hysteresis, double duration, double *cuts, long count,
                        struct transport_error *error, double *work) {
  const double *time = motion->time;
  double last = time[start], from = last, tensor[N * N], w[N], norm, previous, above;
  long first = start, i, reference;
  int j;
  for (;;) {
    reference = steadiest(motion, start, first, stop, from + duration, work);
    if (reference < 0) return count;
    tensor_at(point_of(motion, reference), tensor);
    for (j = 0; j < N; j++) w[j] = motion->velocity[reference * N + j];
    norm = sqrt(product(tensor, w, w));
    previous = 0;
    above = -1e300;
    for (i = reference + 1; i < stop; i++) {
      double angle, now, relative;
      transport_step(time[i] - time[i - 1], point_of(motion, i - 1), w, work);
      tensor_at(point_of(motion, i), tensor);
      now = sqrt(product(tensor, w, w));
      relative = fabs(now - norm) / norm;
      if (!(relative <= error->change) && error->change == error->change) {
        error->change = relative;
        error->at = i;
      }
      norm = now;
      if (motion->state[i]) {
        previous = -1;
        continue;
      }
      angle = angle_between(tensor, w, motion->velocity + i * N);
      if (!(angle > threshold)) above = -1e300;
      else {
        if (above == -1e300)
          above = previous < 0 ? time[i] :
            time[i] - (angle - threshold) / (angle - previous) * (time[i] - time[i - 1]);
        if (angle > threshold + hysteresis) break;
      }
      previous = angle;
    }
    if (i == stop) return count;
    if (above - last >= duration && time[stop] - above >= duration) cuts[count++] = last = above;
    from = above;
    for (first = reference + 1; time[first] < from; first++);
  }
}

/* Times at which an observed motion is cut, at most `points`, whose number is returned; `change`
   and `worst` are a transport_error. */
long segment_motion(long points, const double *time, const double *curve,
                    const double *velocity, const unsigned char *state, double threshold, double hysteresis,
                    double duration, double *cuts, double *change, long *worst) {
  double work[WORK_SIZE];
  struct observed motion;
  struct transport_error error;
  long start, stop, count = 0;
  motion.time = time;
  motion.curve = curve;
  motion.velocity = velocity;
  motion.state = state;
  error.change = 0;
  error.at = 0;
  for (start = 0; start < points - 1; start = stop) {
    for (stop = start + 1; stop < points - 1; stop++)
      if ((state[stop] == 2) != (state[start] == 2)) break;
    cuts[count++] = time[start];
    if (state[start] != 2)
      count = cut_stretch(&motion, start, stop, threshold, hysteresis, duration, cuts, count,
                          &error, work);
  }
  cuts[count++] = time[points - 1];
  *change = error.change;
  *worst = error.at;
  return count;
}
