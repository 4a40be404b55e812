// Times runs of a learner, in Node.js or a browser.

/** Return steps and seconds of a run for each of several seeds. */
export async function times({ load }, name, folder, seeds) {
  const learner = await (await load(name, folder)).create();
  return seeds.map((seed) => {
    learner.begin({ seed });
    const began = performance.now();
    const { lengths } = learner.run();
    return [lengths.reduce((total, length) => total + length, 0), (performance.now() - began) / 1000];
  });
}
