/** Upright's learners in the browser and in Node.js: the package's own compiled code. */

/** A state of the cart-pole, or what is measured of it. */
export interface State {
  /** Position of the cart [m], positive to the right. */
  x: number;
  /** Velocity of the cart [m/s]. */
  x_dot: number;
  /** Angle of the pole [rad], from upright, positive to the right. */
  theta: number;
  /** Angular velocity of the pole [rad/s]. */
  theta_dot: number;
}

/** What a run is to be; what is left out is as the module was built. */
export interface RunOptions {
  /** Seed of the study, below 2^32; 0 if left out. */
  seed?: number;
  /** Number of the run within the study, below 2^32; 0 if left out. */
  run?: number;
  /** Name of a noise case, such as "gaussian-0.1", or sizes by name. */
  noise?: string | Record<string, number>;
  /** Where trials start: "random", "zero" or "wide". */
  start?: string;
  /** Parameters of the plant by name, in SI units. */
  parameters?: Record<string, number>;
  /** Settings of the agent by name. */
  settings?: Record<string, number>;
  /** A trial that lasts this many steps is a success. */
  steps?: number;
  /** A run is at most this many trials. */
  trials?: number;
}

/** Where a number or an array lies in a learner's memory. */
export interface Place {
  type: "bool" | "int64" | "uint64" | "uint32" | "int32" | "uint8" | "float64" | "float32";
  /** Empty for a number. */
  shape: number[];
  /** In bytes from the beginning of the learner's memory. */
  offset: number;
}

/** What a module's JSON file holds. */
export interface Layout {
  agent: string;
  /** Version of the package. */
  version: string;
  /** Bytes of a learner's memory. */
  size: number;
  /** Pages of 64 KiB that a module's memory needs. */
  pages: number;
  places: Record<string, Place>;
  /** Sizes of each noise case. */
  noises: Record<string, Record<string, number>>;
  /** Half-widths of each start. */
  starts: Record<string, State>;
  /** Parameters of the plant, with their meaning and unit, and what they may be. */
  parameters: Record<string, { value: number; low: number; high: number; meaning: string }>;
  /** Places of the settings that can be changed. */
  settings: Record<string, string>;
}

export type Numbers =
  | Float64Array
  | Float32Array
  | BigInt64Array
  | BigUint64Array
  | Int32Array
  | Uint32Array
  | Uint8Array;

/** Load the module of an agent, from the folder of this file or another. */
export function load(name: string, folder?: URL): Promise<LearnerModule>;

/** The module of an agent, which makes any number of learners. */
export class LearnerModule {
  private constructor();
  readonly layout: Layout;
  readonly module: WebAssembly.Module;
  /** Return a learner that knows nothing yet, in memory of its own. */
  create(options?: RunOptions): Promise<Learner>;
}

/** A learner and its cart-pole. */
export class Learner {
  private constructor();
  readonly layout: Layout;
  /** Forget everything and begin a run. */
  begin(options?: RunOptions): void;
  /** Advance by up to `count` steps, and return how many were made: fewer once the run is over. */
  advance(count: number): number;
  /** Make the rest of the run, and return its outcome. */
  run(): { success: boolean; lengths: number[] };
  /** The probability of a push to the right, by default at the last measurement. */
  probability(observation?: State): number;
  /** Once the run is over "succeeded" or "failed". */
  readonly stage: "between" | "balancing" | "succeeded" | "failed";
  /** How many trials have ended. */
  readonly trials: number;
  /** Steps of the present trial; between trials, of the last one. */
  readonly steps: number;
  /** Steps of every trial that has ended. */
  readonly lengths: number[];
  /** The last push: true to the right. */
  readonly action: boolean;
  /** The true state; set it to move the cart or the pole. */
  state: State;
  /** What the agent measured last. */
  readonly observation: State;
  /** Set the noise: the name of a case, or some of its sizes. */
  setNoise(noise: string | Record<string, number>): void;
  /** Set parameters of the plant, in SI units. */
  setParameters(parameters: Record<string, number>): void;
  /** Change settings of the agent that are numbers in its memory. */
  setSettings(settings: Record<string, number>): void;
  /** A number in memory, by the name of its place. */
  number(name: string): number;
  /** Set a number in memory, by the name of its place. */
  set(name: string, value: number): void;
  /** An array in memory, by the name of its place: the numbers themselves, row after row. */
  array(name: string): Numbers;
}
