/* Calls a function of CasADi for many instances, whose arguments and results lie step apart. */
void many(int (*function)(const double **, double **, long long *, double *, int), long long count,
          int num_args, int num_results, const double **args, const long long *arg_steps,
          double **results, const long long *result_steps, double *work) {
  long long k;
  int i;
  for (k = 0; k < count; k++) {
    function(args, results, 0, work, 0);
    for (i = 0; i < num_args; i++) args[i] += arg_steps[i];
    for (i = 0; i < num_results; i++) results[i] += result_steps[i];
  }
}
