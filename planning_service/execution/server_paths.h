// SPDX-License-Identifier: Apache-2.0
// Removes the paths of this machine from messages of jobs, before clients read them.
#pragma once

#include <string>
#include <vector>

namespace sightline {

// A client knows its files and results by their names. All messages of a job to its client (errors,
// progress, the last lines of a process) go through this class; logs keep the whole paths. With
// the job's folder /data/work/job-1:
//
//   /data/work/job-1/in/part.glb: is no mesh         part.glb: is no mesh
//   ../out/plan.json: cannot be written              plan.json: cannot be written
//   "/opt/sightline/bin/coverage_server" ended       "coverage_server" ended
//   /data/artefacts/ab/abcd: No such file            abcd: No such file
//   --step-cache=/data/step_cache                    --step-cache=(a folder of the service)
class ServerPaths {
 public:
  // `job_folder`: absolute path; commands run in its folder `in`. `folders`: absolute paths of all
  // other folders whose files messages may name: data, programs, temporary files. Both the given
  // path and the path with links resolved are recognised, because programs may report either.
  ServerPaths(const std::string& job_folder, const std::vector<std::string>& folders);

  // Returns `message` with shorter paths: files in the job's folders `in` and `out` relative to
  // these, files in the other folders by their file name alone. Names that only contain such a
  // path, as "mine/data/work" does, stay.
  std::string WithoutPaths(const std::string& message) const;

 private:
  struct Folder {
    std::string path;
    bool of_job = false;  // a folder of the job: its files keep their paths below it
  };
  void Add(const std::string& path, bool of_job);

  std::vector<Folder> folders_;  // longer ones first
};

// The folders of a program of this product and of its files, for ServerPaths. `program`:
// absolute path.
std::vector<std::string> FoldersOfProgram(const std::string& program);

}  // namespace sightline
