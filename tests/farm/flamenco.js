// Compiles a job as Flamenco's Manager does: node flamenco.js JOB_TYPE.js SETTINGS.json. Prints its tasks as JSON.

const fs = require("fs");
const vm = require("vm");

const [script, settings] = process.argv.slice(2);

class Task {
  constructor(name, type) {
    Object.assign(this, { name, type, commands: [], dependencies: [] });
  }
  addCommand(command) {
    this.commands.push(command);
  }
  addDependency(task) {
    this.dependencies.push(task.name);
  }
}

const tasks = [];
const world = {
  author: {
    Task: (name, type) => new Task(name, type),
    Command: (name, parameters) => ({ name, parameters }),
  },
  // Of one range, as the Manager's own does it.
  frameChunker: (range, size) => {
    const [, first, last] = range.match(/^(-?\d+)-(-?\d+)$/).map(Number);
    const chunks = [];
    for (let start = first; start <= last; start += size) {
      const end = Math.min(start + size - 1, last);
      chunks.push(start === end ? `${start}` : `${start}-${end}`);
    }
    return chunks;
  },
  job: { settings: JSON.parse(settings), addTask: (task) => tasks.push(task) },
  print: () => {},
};
vm.createContext(world);
vm.runInContext(fs.readFileSync(script, "utf8"), world);
const jobType = vm.runInContext("JOB_TYPE", world);
for (const { key, default: value } of jobType.settings) {
  if (!(key in world.job.settings) && value !== undefined) world.job.settings[key] = value;
}
vm.runInContext("compileJob(job)", world);
console.log(JSON.stringify({ settings: jobType.settings, tasks }));
