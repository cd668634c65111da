// SPDX-License-Identifier: Apache-2.0
// Messages of jobs as clients may read them: without the paths of this machine.
#pragma once

#include <string>
#include <vector>

namespace sightline {

// A client knows its files by the names that it gave them, and results by their names. Everything
// that a job says to its client, errors, progress and the last lines of a process, goes through
// here; logs keep the whole paths. With the job's folder /data/work/job-1:
//
//   /data/work/job-1/in/part.glb: is no mesh         part.glb: is no mesh
//   ../out/plan.json: cannot be written              plan.json: cannot be written
//   "/opt/sightline/bin/coverage_server" ended       "coverage_server" ended
//   /data/artefacts/ab/abcd: No such file            abcd: No such file
//   --step-cache=/data/step_cache                    --step-cache=(a folder of the service)
class ServerPaths {
 public:
  // `job_folder`: absolute path; commands run in its folder `in`. `folders`: absolute paths of all
  // other folders whose files messages may name: data, programs, temporary files. Links on the way
  // to a folder are followed as well, since programs see the path without them.
  ServerPaths(const std::string& job_folder, const std::vector<std::string>& folders);

  // `message` with every file in the job's folders `in` and `out` named from there, and every other
  // file in a folder that was given by its last name. Names that only contain such a path, as
  // "mine/data/work" does, stay.
  std::string WithoutPaths(const std::string& message) const;

 private:
  struct Folder {
    std::string path;
    bool of_job = false;  // its files keep their names below it
  };
  void Add(const std::string& path, bool of_job);

  std::vector<Folder> folders_;  // longer ones first
};

// The folders of a program of this product and of its files, for ServerPaths. `program`:
// absolute path.
std::vector<std::string> FoldersOfProgram(const std::string& program);

}  // namespace sightline
