// The progress function of a run.

/**
 * Separates the progress function from the other options, and calls `run` with both. An exception of the function cancels
 * the run, and is thrown in place of its error.
 */
export function withProgress(options, run) {
  const { onProgress, ...rest } = options ?? {};
  let thrown = null;
  const guarded = (done, stage) => {
    try {
      return onProgress(done, stage);
    } catch (error) {
      thrown = { error };
      return false;
    }
  };
  try {
    return run(rest, onProgress && guarded);
  } catch (error) {
    throw thrown ? thrown.error : error;
  }
}
