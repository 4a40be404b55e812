// node proof_in_node.mjs FOLDER NAME NOISES OPTIONS prints the outcomes as JSON.
import { pathToFileURL } from "node:url";
import { outcomes } from "./proof.js";

const [folder, name, noises, options] = process.argv.slice(2);
const place = pathToFileURL(`${folder}/`);
const upright = await import(new URL("upright.js", place));
const found = await outcomes(upright, name, place, JSON.parse(noises), JSON.parse(options));
console.log(JSON.stringify(found));
