#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <Eigen/LU>
#include <algorithm>
#include <exception>
#include <memory>
#include <tuple>
#include <variant>

#include "arrays.h"
#include "json_of.h"
#include "kept_program.h"
#include "sinew/rig_file.h"
#include "sinew/rig_program.h"
#include "sinew/skeleton.h"
#include "sinew/threads.h"

namespace sinew::bindings {
namespace {

/// What a caller gives for an evaluation, with the memory of its numbers.
class Inputs {
 public:
  Inputs(const RigProgram& program, const py::dict& set, py::ssize_t frames) {
    for (const auto& [key, value] : set) {
      if (!py::isinstance<py::str>(key)) throw InputError(value_text(key) + " is not a path; expected text");
      const auto held = py::reinterpret_borrow<py::object>(value);  // what becomes an array may change the dictionary
      const std::string name = py::str(key);
      const py::array array = py::array::ensure(held);
      if (!array) throw InputError("the value of " + name + " is no array of numbers");
      numbers_.push_back(copied<float>(name.c_str(), array));
      const auto& matrices = program.matrix_names();
      const auto matrix = std::find(matrices.begin(), matrices.end(), name);
      if (matrix != matrices.end()) {
        add_matrix(name, static_cast<int>(matrix - matrices.begin()), array, frames);
      } else {
        add_value(name, program.find_value(name), array, frames);
      }
    }
  }

  const GivenInputs& given() const { return given_; }

 private:
  /// (count,) for all frames or (F, count); a single number's second axis may be missing.
  void add_value(const std::string& name, const RigProgram::Place& place, const py::array& array, py::ssize_t frames) {
    const std::string of_all = std::to_string(frames), count = std::to_string(place.count);
    const bool is_single = place.count == 1, is_once = array.ndim() == (is_single ? 0 : 1);
    require_shape(name.c_str(), array,
                  is_single ? "() or (" + of_all + ",)" : "(" + count + ",) or (" + of_all + ", " + count + ")");
    given_.values.push_back({place.first, place.count, numbers_.back().data(), is_once ? 0 : place.count});
  }

  void add_matrix(const std::string& name, int index, const py::array& array, py::ssize_t frames) {
    require_shape(name.c_str(), array, "(4, 4) or (" + std::to_string(frames) + ", 4, 4)");
    std::vector<float>& numbers = numbers_.back();
    for (std::size_t i = 0; i < numbers.size(); i += 16) {
      Eigen::Map<Eigen::Matrix4f>(numbers.data() + i).transposeInPlace();
    }
    given_.matrices.push_back({index, numbers.data(), array.ndim() == 2 ? 0 : 16});
  }

  std::vector<std::vector<float>> numbers_;
  GivenInputs given_;
};

/// Evaluates frames with the GIL released. make_outputs returns where it writes.
template <class MakeOutputs>
void evaluate(const RigProgram& program, const py::array& frames, const py::dict& set,
              const MakeOutputs& make_outputs) {
  const std::vector<float> times = list_of<float>("frames", frames);
  const Inputs inputs(program, set, static_cast<py::ssize_t>(times.size()));
  const RigOutputs outputs = make_outputs(static_cast<py::ssize_t>(times.size()));
  const py::gil_scoped_release release;
  program.evaluate(times, inputs.given(), outputs);
}

/// Evaluates frames into matrices. count: how many of a frame, (F, count, 4, 4) of all.
py::array matrices_of(const RigProgram& program, const py::array& frames, const py::dict& set, py::ssize_t count,
                      std::optional<MatrixStack<float>> RigOutputs::*part) {
  py::array_t<float> matrices;
  evaluate(program, frames, set, [&](py::ssize_t frame_count) {
    matrices = py::array_t<float>({frame_count, count, py::ssize_t{4}, py::ssize_t{4}});
    RigOutputs outputs;
    outputs.*part = matrix_stack<float>("out", matrices);
    return outputs;
  });
  return matrices;
}

py::array py_evaluate(const RigProgram& program, const py::array& frames, const py::dict& set) {
  return matrices_of(program, frames, set, program.bone_count(), &RigOutputs::poses);
}

std::shared_ptr<RigProgram> py_edited(const RigProgram& program, const py::dict& set, const py::list& curves) {
  const Inputs inputs(program, set, 1);
  return kept_edit(program, program.edited(inputs.given(), animated_values_of(json_of(curves))), set, curves);
}

std::shared_ptr<RigProgram> program_of_state(const py::tuple& state) {
  if (state.size() != 3) throw InputError("this is not the state of a RigProgram");
  const auto program = kept_program(state[0], true);
  const py::dict set = state[1];
  const py::list curves = state[2];
  return set.empty() && curves.empty() ? program : py_edited(*program, set, curves);
}

py::array py_segments(const RigProgram& program, const py::array& frames, const py::dict& set) {
  return matrices_of(program, frames, set, program.segment_begin().back(), &RigOutputs::segments);
}

py::array py_motions(const RigProgram& program, const py::array& frames, const py::dict& set) {
  return matrices_of(program, frames, set, program.joint_begin().back(), &RigOutputs::motions);
}

BoneSpace bone_space_of(const char* what, const std::string& name) {
  constexpr std::array<const char*, 4> kNames = {"WORLD", "POSE", "LOCAL", "LOCAL_WITH_PARENT"};
  const auto* const found = std::find(kNames.begin(), kNames.end(), name);
  if (found == kNames.end()) {
    throw InputError(std::string(what) + " is \"" + name + "\"; expected WORLD, POSE, LOCAL or LOCAL_WITH_PARENT");
  }
  return static_cast<BoneSpace>(found - kNames.begin());
}

py::array py_convert(const RigProgram& program, const py::array& poses, int bone, const std::string& from,
                     const std::string& to) {
  if (bone < 0 || bone >= program.bone_count()) {
    throw InputError("bone is " + std::to_string(bone) + ", and the rig has " + std::to_string(program.bone_count()));
  }
  require_shape("poses", poses, "(F, " + std::to_string(program.bone_count()) + ", 4, 4)");
  py::array_t<float> out({poses.shape(0), py::ssize_t{1}, py::ssize_t{4}, py::ssize_t{4}});
  program.convert(matrix_stack<const float>("poses", poses), bone, bone_space_of("from_space", from),
                  bone_space_of("to_space", to), matrix_stack<float>("out", out));
  return out.reshape({poses.shape(0), py::ssize_t{4}, py::ssize_t{4}});
}

py::array_t<float> rest_of(const RigProgram& program) {
  py::array_t<float> rest({static_cast<py::ssize_t>(program.bone_count()), py::ssize_t{4}, py::ssize_t{4}});
  const MatrixStack<float> stack = matrix_stack<float>("rest", rest);
  for (std::ptrdiff_t bone = 0; bone < program.bone_count(); ++bone) stack.at(0, bone) = program.rest(bone);
  return rest;
}

/// The chosen bones as a tree, each below the nearest of its ancestors that is chosen.
Skeleton skeleton_of(const RigProgram& program, const std::vector<std::int32_t>& bones) {
  std::vector<std::int32_t> joint_of(program.bone_count(), -1);
  for (std::size_t j = 0; j < bones.size(); ++j) {
    if (bones[j] < 0 || bones[j] >= program.bone_count()) {
      throw InputError("there is no bone " + std::to_string(bones[j]) + "; the rig has " +
                       std::to_string(program.bone_count()));
    }
    joint_of[bones[j]] = static_cast<std::int32_t>(j);
  }
  std::vector<std::int32_t> parents;
  std::vector<Matrix4<double>> rest;
  for (const std::int32_t bone : bones) {
    std::int32_t above = program.parents()[bone];
    while (above >= 0 && joint_of[above] < 0) above = program.parents()[above];
    parents.push_back(above < 0 ? -1 : joint_of[above]);
    const Matrix4<double> own = program.rest(bone).cast<double>();
    rest.push_back(above < 0 ? own : Matrix4<double>(program.rest(above).cast<double>().inverse() * own));
  }
  return Skeleton(parents, rest);
}

py::dict paths_of(const RigProgram& program) {
  py::dict counts;
  for (const RigProgram::Property& each : program.properties()) counts[py::str(each.path)] = each.place.count;
  return counts;
}

std::shared_ptr<RigProgram> program_of(const std::variant<py::dict, std::filesystem::path>& given,
                                       bool keeps_description) {
  if (const auto* description = std::get_if<py::dict>(&given)) return kept_program(*description, keeps_description);
  const py::object path = py::cast(std::get<std::filesystem::path>(given));
  try {
    const py::object file = py::module_::import("io").attr("open")(path, "rb");
    const py::object text = file.attr("read")();
    file.attr("close")();
    return kept_program(text, keeps_description);
  } catch (const InputError& error) {
    throw InputError(std::string(py::str(path)) + ": " + error.what());
  } catch (py::error_already_set& error) {
    if (!error.matches(PyExc_OSError) && !error.matches(PyExc_ValueError)) throw;
    throw InputError(std::string(py::str(path)) + ": " + std::string(py::str(error.value())));
  }
}

/// The places of all numbers of each path.
std::vector<int> places_of(const RigProgram& program, const std::vector<std::string>& paths) {
  std::vector<int> places;
  for (const std::string& path : paths) {
    const RigProgram::Place place = program.find_value(path);
    for (int i = 0; i < place.count; ++i) places.push_back(place.first + i);
  }
  return places;
}

py::array py_values(const RigProgram& program, const py::array& frames, const std::vector<std::string>& paths,
                    const py::dict& set) {
  const std::vector<int> places = places_of(program, paths);
  py::array_t<float> values;
  evaluate(program, frames, set, [&](py::ssize_t count) {
    values = py::array_t<float>({count, static_cast<py::ssize_t>(places.size())});
    RigOutputs outputs;
    outputs.values = places;
    outputs.numbers = values.mutable_data();
    return outputs;
  });
  return values;
}

using FieldTuple = std::tuple<std::string, int, int>;

std::vector<RecordField> fields_of(const std::vector<FieldTuple>& given) {
  using enum RecordField::Part;
  constexpr std::pair<std::string_view, RecordField::Part> kParts[] = {{"channel_matrix", channel_matrix},
                                                                       {"pose_matrix", pose_matrix},
                                                                       {"head", head},
                                                                       {"tail", tail},
                                                                       {"values", values}};
  std::vector<RecordField> fields;
  for (const auto& [name, first, count] : given) {
    const auto* const part = std::ranges::find(kParts, name, [](const auto& each) { return each.first; });
    if (part == std::end(kParts))
      throw InputError("a field is named \"" + name + "\"; expected pose_matrix or another");
    fields.push_back({part->second, first, count});
  }
  return fields;
}

/// What a RigPlayer computes of each frame.
struct Played {
  std::shared_ptr<RigProgram> program;
  std::vector<RecordField> fields;
  std::vector<int> places;          // of all parts
  std::vector<std::size_t> counts;  // of each part
};

/// A frame of several rigs, with the memory that it is computed into.
class RigFrames {
 public:
  explicit RigFrames(float time) : time_(time) {}
  RigFrames(const RigFrames&) = delete;

  float time() const { return time_; }

  void add(const std::shared_ptr<const Played>& played, const py::dict& set) {
    OfRig& own = rigs_.emplace_back(OfRig{played, Inputs(*played->program, set, 1)});
    const std::ptrdiff_t size = played->program->record_size(played->fields);
    own.record = py::array_t<std::uint8_t>(size);
    own.numbers.resize(played->places.size());
    own.outputs.values = played->places;
    own.outputs.numbers = own.numbers.data();
    own.outputs.records = {played->fields, reinterpret_cast<std::byte*>(own.record.mutable_data()), size};
  }

  std::size_t size() const { return rigs_.size(); }

  /// Computes that of rig i. Without the GIL, in any thread.
  void compute(std::size_t i) {
    OfRig& own = rigs_[i];
    try {
      own.played->program->evaluate({&time_, 1}, own.inputs.given(), own.outputs);
    } catch (const InputError& error) {
      own.error = error.what();
    } catch (...) {
      own.fault = std::current_exception();
    }
  }

  /// Has other threads compute all.
  void begin() {
    meanwhile_.emplace(size(), [this](std::size_t i) { compute(i); });
  }

  /// Waits until all that was begun is computed. Without the GIL.
  void wait() {
    if (meanwhile_) meanwhile_->wait();
  }

  /// Returns what RigPlayer.moments returns of rig i.
  py::object moment(std::size_t i) const {
    const OfRig& own = rigs_[i];
    if (own.fault) std::rethrow_exception(own.fault);
    if (!own.error.empty()) return py::str(own.error);
    py::list moment;
    moment.append(own.record);
    auto number = own.numbers.begin();
    for (const std::size_t count : own.played->counts) {
      py::tuple numbers(count);
      for (std::size_t k = 0; k < count; ++k) numbers[k] = py::float_(*number++);
      moment.append(numbers);
    }
    return moment;
  }

 private:
  struct OfRig {
    std::shared_ptr<const Played> played;
    Inputs inputs;
    py::array_t<std::uint8_t> record = {};
    std::vector<float> numbers = {};
    RigOutputs outputs = {};
    std::string error = {};         // what is wrong with the rig
    std::exception_ptr fault = {};  // anything else, such as too little memory
  };
  float time_;
  std::vector<OfRig> rigs_;
  std::optional<Meanwhile> meanwhile_;  // ends before them
};

/// A rig whose frames are played, and the frame that other threads compute of it ahead.
class RigPlayer {
 public:
  RigPlayer(const std::shared_ptr<RigProgram>& program, const std::vector<std::vector<std::string>>& parts,
            const std::vector<FieldTuple>& fields)
      : played_(std::make_shared<Played>(Played{program, fields_of(fields), {}, {}})) {
    program->record_size(played_->fields);  // checks them
    for (const auto& paths : parts) {
      const std::vector<int> own = places_of(*program, paths);
      played_->places.insert(played_->places.end(), own.begin(), own.end());
      played_->counts.push_back(own.size());
    }
  }

  const std::shared_ptr<RigProgram>& program() const { return played_->program; }

  RigPlayer edited(const py::dict& set, const py::list& curves) const {
    Played after = *played_;
    after.program = py_edited(*played_->program, set, curves);
    return RigPlayer(std::make_shared<Played>(std::move(after)));
  }

  static void begin(const std::vector<std::shared_ptr<RigPlayer>>& players, float frame) {
    const auto frames = std::make_shared<RigFrames>(frame);
    for (const auto& player : players) frames->add(player->played_, {});
    frames->begin();
    for (std::size_t i = 0; i < players.size(); ++i) players[i]->ahead_ = {frames, i};
  }

  static py::list moments(const std::vector<std::pair<std::shared_ptr<RigPlayer>, py::dict>>& rigs, float frame) {
    const auto late = std::make_shared<RigFrames>(frame);
    std::vector<Ahead> found;
    for (const auto& [player, set] : rigs) {
      const bool is_ahead = set.empty() && player->ahead_.frames && player->ahead_.frames->time() == frame;
      found.push_back(is_ahead ? player->ahead_ : Ahead{late, late->size()});
      if (!is_ahead) late->add(player->played_, set);
    }
    {
      const py::gil_scoped_release release;
      run_parallel(late->size(), [&](std::size_t i) { late->compute(i); });
      for (const Ahead& each : found) each.frames->wait();
    }
    py::list moments;
    for (const auto& [frames, number] : found) moments.append(frames->moment(number));
    return moments;
  }

 private:
  struct Ahead {
    std::shared_ptr<RigFrames> frames;
    std::size_t number = 0;  // of the rig
  };

  explicit RigPlayer(std::shared_ptr<Played> played) : played_(std::move(played)) {}

  std::shared_ptr<Played> played_;
  Ahead ahead_;
};

py::dict py_profile(const RigProgram& program, const py::array& frames, const py::dict& set) {
  const std::vector<float> times = list_of<float>("frames", frames);
  const Inputs inputs(program, set, static_cast<py::ssize_t>(times.size()));
  std::array<double, kRigPartCount> seconds{};
  {
    const py::gil_scoped_release release;
    seconds = program.profile(times, inputs.given());
  }
  py::dict parts;
  const char* const names[] = {"curves", "drivers", "bones", "ik", "segments"};
  static_assert(std::size(names) == kRigPartCount);
  for (int i = 0; i < kRigPartCount; ++i) parts[names[i]] = seconds[i];
  return parts;
}

py::dict settings_dict(std::span<const RigSetting> settings) {
  constexpr const char* kKinds[] = {"FLOAT", "INT", "BOOLEAN", "ENUM"};
  py::dict found;
  for (const RigSetting& setting : settings) {
    found[py::str(std::string(setting.name))] = py::make_tuple(setting.count, kKinds[static_cast<int>(setting.kind)],
                                                               setting.initial, setting.low, setting.high);
  }
  return found;
}

py::dict constraint_settings_dict() {
  py::dict types;
  for (int i = 0; i < kConstraintTypeCount; ++i) {
    const auto type = static_cast<ConstraintType>(i);
    types[py::str(std::string(constraint_name(type)))] = settings_dict(constraint_settings(type));
  }
  return types;
}

}  // namespace

void bind_rigs(py::module_& module) {
  py::class_<RigProgram, std::shared_ptr<RigProgram>>(
      module, "RigProgram", "An armature's bones, constraints, drivers and curves, evaluated as Blender does.")
      .def(py::init(&program_of), py::arg("description"), py::arg("keep_description") = true,
           "Checks a description, or the file of one that `sinew rig` has written, and puts it in order.\n\n"
           "keep_description: whether it can be pickled, for which it keeps a copy of the description.\n"
           "Raises ValueError, which names what is wrong or not covered.")
      .def(py::pickle(&state_of, &program_of_state))
      .def("__copy__", [](const std::shared_ptr<RigProgram>& self) { return self; })
      .def(
          "__deepcopy__", [](const std::shared_ptr<RigProgram>& self, const py::dict&) { return self; },
          py::arg("memo"))
      .def_property_readonly("names", &RigProgram::bone_names, "The bones' B unique names.")
      .def_property_readonly(
          "parents", [](py::object self) { return view_list(self.cast<const RigProgram&>().parents(), self); },
          "B, the parent of each bone or -1.")
      .def_property_readonly(
          "segment_begin",
          [](py::object self) { return view_list(self.cast<const RigProgram&>().segment_begin(), self); },
          "B + 1, where each B-bone's matrices begin in segments(); other bones have none.")
      .def_property_readonly(
          "joint_begin", [](py::object self) { return view_list(self.cast<const RigProgram&>().joint_begin(), self); },
          "B + 1, where each bone's joints begin in skinning_matrices(): one, or of a B-bone those of all ends of its "
          "segments.")
      .def_property_readonly("rest", &rest_of, "(B, 4, 4) float32, the bones' rest matrices in armature space.")
      .def(
          "skeleton", &skeleton_of, py::arg("bones"),
          "Returns bones as a Skeleton, for local_transforms() of evaluate()'s poses of these bones: at rest as in the "
          "rig, each below the nearest of its ancestors that is among them.\n\n"
          "bones: the numbers of J bones. Raises ValueError for a number that the rig does not have.")
      .def_property_readonly(
          "paths", &paths_of,
          "What evaluate() takes, and how many numbers each has: settings of bones and constraints, custom properties, "
          "and values from outside; see matrix_names too.")
      .def_property_readonly("driven", &RigProgram::driven, "The numbers that drivers set, whatever is given.")
      .def_property_readonly("keyed", &RigProgram::keyed, "The numbers that follow curves unless they are given.")
      .def_property_readonly("matrix_names", &RigProgram::matrix_names,
                             "The objects and other rigs' bones whose world matrices come from outside.")
      .def(
          "edited", &py_edited, py::arg("set"), py::arg("curves"),
          "Returns the same rig after an edit of its pose or its keys, without putting it in order again.\n\n"
          "set: as of evaluate(), but for good and as Blender stores it: curves replace these values. Not for settings "
          "of constraints. curves: rows as the description's, which replace those of the same properties. Raises "
          "ValueError for a setting of a constraint, a number that is not finite, and a property without a curve.")
      .def(
          "evaluate", &py_evaluate, py::arg("frames"), py::arg("set") = py::dict(),
          "Returns the bones' matrices in armature space, (F, B, 4, 4) float32.\n\n"
          "frames: (F,) times, which may be fractions.\n"
          "set: values for paths such as 'pose.bones[\"Hand\"].location', "
          "(count,) for all frames or (F, count), and matrices from outside by name, (4, 4) or (F, 4, 4); they replace "
          "the description's values and curves, and drivers replace them. Raises ValueError for an unknown path, for a "
          "wrong shape, for a rotation in a mode that its bone or object does not have, which would move nothing, and "
          "if a "
          "driver divides by 0.")
      .def("segments", &py_segments, py::arg("frames"), py::arg("set") = py::dict(),
           "Returns the matrices at the ends of the B-bones' segments, relative to their bones, (F, S, 4, 4) "
           "float32.\n\n"
           "frames: (F,) times.\n"
           "set: as in evaluate(), and so are the errors.")
      .def("convert", &py_convert, py::arg("poses"), py::arg("bone"), py::arg("from_space"), py::arg("to_space"),
           "Returns the matrices of a bone in another space, (F, 4, 4) float32, with the bits of "
           "Object.convert_space.\n\n"
           "poses: (F, B, 4, 4), as evaluate() returns them.\n"
           "bone: its number.\n"
           "from_space: where the conversion begins: 'POSE' for what drivers read, 'WORLD' for constraints.\n"
           "to_space: 'WORLD', 'POSE', 'LOCAL' or 'LOCAL_WITH_PARENT'. Raises ValueError for any other name, and for "
           "a bone that the rig does not have.")
      .def("skinning_matrices", &py_motions, py::arg("frames"), py::arg("set") = py::dict(),
           "Returns the matrices that move vertices from rest to pose, in armature space, (F, J, 4, 4) float32, for "
           "skins whose joints are numbered as joint_begin says.\n\n"
           "frames: (F,) times.\n"
           "set: as in evaluate(), and so are the errors.")
      .def("values", &py_values, py::arg("frames"), py::arg("paths"), py::arg("set") = py::dict(),
           "Returns what properties hold, (F, N) float32, all numbers of each path one after the other.\n\n"
           "frames: (F,) times.\n"
           "set: as in evaluate(), and so are the errors.")
      .def("profile", &py_profile, py::arg("frames"), py::arg("set") = py::dict(),
           "Evaluates frames on one thread and returns the seconds that its parts took, all frames together: 'curves', "
           "'drivers', 'bones' with their constraints, 'ik' and 'segments' of B-bones.\n\n"
           "frames: (F,) times.\n"
           "set: as in evaluate(), and so are the errors.");
  py::class_<RigPlayer, std::shared_ptr<RigPlayer>>(
      module, "RigPlayer", "Computes what Blender's evaluation of a frame would leave in the memory of a rig's bones.")
      .def(py::init<const std::shared_ptr<RigProgram>&, const std::vector<std::vector<std::string>>&,
                    const std::vector<FieldTuple>&>(),
           py::arg("program"), py::arg("parts"), py::arg("fields"),
           "parts: paths, of numbers that are returned too, in groups.\n"
           "fields: (name, first, count) of what a bone holds, in this order: 'channel_matrix', 'pose_matrix', 'head' "
           "and 'tail'; 'values' are `count` of the bone's numbers from `first` on, in the order of "
           "rig_bone_settings(). Raises ValueError for a field or a path that the rig does not have.")
      .def_property_readonly("program", &RigPlayer::program, "The RigProgram.")
      .def("edited", &RigPlayer::edited, py::arg("set"), py::arg("curves"),
           "Returns a player of what RigProgram.edited() returns, with its arguments and errors.")
      .def_static("moments", &RigPlayer::moments, py::arg("rigs"), py::arg("frame"),
                  "Returns a frame of several rigs, which are computed at the same time.\n\n"
                  "rigs: of each (player, what RigProgram.evaluate() takes as `set`).\n"
                  "Returns of each a list: its record, (N,) uint8, which is what host.record_pose returns, with the "
                  "rig's dual quaternions; then of each part its numbers. Or a sentence if a driver divides by 0.")
      .def_static("begin", &RigPlayer::begin, py::arg("players"), py::arg("frame"),
                  "Has other threads compute a frame of several rigs, which moments() returns later if nothing is "
                  "set. Each player keeps the last one that was begun.");
  module.def(
      "rig_bone_settings",
      [] {
        py::list settings;
        for (const RigSetting& setting : bone_settings()) {
          settings.append(py::make_tuple(std::string(setting.name), setting.count));
        }
        return settings;
      },
      "The numbers of a bone that may change: name and how many. Those of the pose come first; a name that occurs "
      "again is the rest bone's.");
  module.def(
      "rig_constraint_settings", &constraint_settings_dict,
      "The settings of each type of constraint, and of each how many numbers it has, their type, default and limits.");
}

}  // namespace sinew::bindings
