// The site's search without a browser: node site_search.mjs SITE, with a JSON list of questions on standard input.
// Prints a JSON list: for each question the addresses of its first three hits, a list for each page.
import fs from "fs";
import path from "path";
import vm from "vm";

const site = process.argv[2];
const folder = path.join(site, "assets/javascripts/workers");
const [worker] = fs.readdirSync(folder).filter((name) => /^search\..*\.js$/.test(name));

// the theme's worker, in a context that has what a browser's worker has
const listeners = [];
let reply = null;
const context = vm.createContext({
  addEventListener: (kind, listener) => kind === "message" && listeners.push(listener),
  postMessage: (data) => reply?.(data),
  console, importScripts() {}, setTimeout, performance, navigator: {}, location: { href: "" }, structuredClone,
});
context.self = context;
vm.runInContext(fs.readFileSync(path.join(folder, worker), "utf8"), context);
const send = (message) => new Promise((done) => {
  reply = done;
  listeners.forEach((listener) => listener({ data: message }));
});

// search.js changes what a page posts to its worker
let asked = null;
class Worker { postMessage(message) { asked = message.data; } }
vm.runInContext(fs.readFileSync(path.join(site, "assets/search.js"), "utf8"), vm.createContext({ Worker, console }));

const index = JSON.parse(fs.readFileSync(path.join(site, "search/search_index.json"), "utf8"));
index.options = { suggest: false };
await send({ type: 0, data: index });
const found = [];
for (const question of JSON.parse(fs.readFileSync(0, "utf8"))) {
  new Worker().postMessage({ type: 2, data: question });
  const { data } = await send({ type: 2, data: asked });
  found.push(data.items.slice(0, 3).map((page) =>
    page.filter((hit) => hit.score >= page[0].score || !hit.location.includes("#")).map((hit) => hit.location)));
}
console.log(JSON.stringify(found));
