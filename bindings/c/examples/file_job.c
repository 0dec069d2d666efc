/* Runs a job on a file and prints its outcome: file_job VERB INPUT OUTPUT OPTIONS, such as
   file_job simplify statue.glb small.glb '{"ratio": 0.1}' */
#include <stdio.h>
#include <lodsmith.h>

#ifdef LODSMITH_FILES

int main(int count, char **words) {
  lodsmith_file_job job = {0};
  lodsmith_text *outcome = NULL;
  if (count != 5) {
    fprintf(stderr, "usage: file_job VERB INPUT OUTPUT OPTIONS\n");
    return 2;
  }
  job.size = sizeof job;
  job.verb = words[1];
  job.input = words[2];
  job.output = words[3];
  job.options = words[4];
  if (lodsmith_run_file_job(&job, NULL, NULL, &outcome) != LODSMITH_OK) {
    fprintf(stderr, "%s\n", lodsmith_error_message());
    return 1;
  }
  puts(lodsmith_text_get(outcome));
  lodsmith_text_free(outcome);
  return 0;
}

#else

int main(void) {
  fprintf(stderr, "this library was built without jobs on files\n");
  return 1;
}

#endif
