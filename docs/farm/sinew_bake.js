// A job type for Flamenco 3: bakes meshes of a .blend into point caches, a chunk of frames a task, and verifies the
// whole when all of them are done. It goes into the folder `scripts` beside the Manager; the workers need Blender 4.2 or
// later with Sinew enabled.

const JOB_TYPE = {
  label: "Sinew Bake",
  description: "Bake meshes into point caches",
  settings: [
    {
      key: "frames", type: "string", required: true,
      eval: "f'{C.scene.frame_start}-{C.scene.frame_end}'",
      evalInfo: { showLinkButton: true, description: "Scene frame range" },
      description: "All frames of the bake, for example 1-240",
    },
    { key: "chunk_size", type: "int32", default: 50, visible: "submission", description: "Frames that a task bakes" },
    {
      key: "output", type: "string", subtype: "dir_path", required: true, visible: "submission",
      description: "A folder that all workers can write to; it is made if it is missing",
    },
    {
      key: "objects", type: "string", default: "", visible: "submission",
      description: "Names, separated by commas; if empty, all visible meshes with modifiers or shape keys",
    },
    { key: "format", type: "string", choices: ["pc2", "mdd"], default: "pc2", visible: "submission" },
    {
      key: "until_subdivision", type: "bool", default: false, visible: "submission",
      description: "Bake the shape before the first Subdivision Surface modifier",
    },
    { key: "blendfile", type: "string", required: true, visible: "web", description: "Path of the Blend file to bake" },
  ],
};

function compileJob(job) {
  const settings = job.settings;
  if (!/^-?\d+--?\d+$/.test(settings.frames)) {
    throw new Error(`${settings.frames} is not a range of frames; write it like 1-240`);
  }
  const verify = bakeTask("verify", settings, "--verify");
  for (const chunk of frameChunker(settings.frames, settings.chunk_size)) {
    const task = bakeTask(`bake-${chunk}`, settings, `--chunk=${chunk}`);
    verify.addDependency(task);
    job.addTask(task);
  }
  job.addTask(verify);
}

function bakeTask(name, settings, part) {
  const options = ["--output", settings.output, `--frames=${settings.frames}`, "--format", settings.format, part];
  if (settings.objects) options.push("--objects", settings.objects);
  if (settings.until_subdivision) options.push("--until-subdivision");
  const task = author.Task(name, "blender");
  task.addCommand(
    author.Command("blender-render", {
      exe: "{blender}",
      exeArgs: "{blenderArgs}",
      argsBefore: [],
      blendfile: settings.blendfile,
      args: ["--command", "sinew", "bake"].concat(options),
    }),
  );
  return task;
}
