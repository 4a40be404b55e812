// Runs of a learner, for Node.js and for a browser: the same calls of upright.js.

/** Return the outcome and the memory (as base64) of a run under each noise. */
export async function outcomes({ load }, name, folder, noises, options) {
  const learner = await (await load(name, folder)).create();
  return noises.map((noise) => {
    learner.begin({ noise, ...options });
    // A run in pieces of several sizes is the run.
    for (const count of [0, 1, 2, 30, 500]) learner.advance(count);
    const { success, lengths } = learner.run();
    return { noise, success, lengths, memory: base64(learner) };
  });
}

function base64(learner) {
  const { size } = learner.layout;
  const places = Object.entries(learner.layout.places);
  const [first] = places.find(([, { offset }]) => offset === 0);
  const { buffer, byteOffset } = learner.array(first);
  let text = "";
  for (const byte of new Uint8Array(buffer, byteOffset, size)) text += String.fromCharCode(byte);
  return btoa(text);
}
