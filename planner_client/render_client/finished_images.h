// SPDX-License-Identifier: Apache-2.0
// Finished images of a request in a folder, from which an interrupted rendering continues.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

// A list of finished images in a file, one JSON line each, with the digest of their request and of
// the worker that made them.
class FinishedImages {
 public:
  // Reads the list in `file` and other lists beside it whose names begin alike, and rewrites
  // `file`. Entries are ignored if they are damaged or belong to another request or another build
  // of the worker (`worker_build`: GetRenderWorkerResponse.server_build), and so are images whose
  // files are missing from `folder` or have changed. INTERNAL: the file cannot be written.
  static absl::StatusOr<FinishedImages> Open(const std::string& file, const std::string& folder,
                                             const v1::RenderSpec& spec,
                                             const std::string& worker_build);

  // Numbers of finished images, ascending.
  const std::vector<int>& images() const { return images_; }
  // Their files.
  const std::vector<std::string>& files() const { return files_; }
  // A sentence for every ignored list, and for every image of the others that is no longer
  // intact.
  const std::vector<std::string>& remarks() const { return remarks_; }

  // Adds a file that is complete in the folder. All files of an image must come consecutively; the
  // first file of the next image, or of image -1, marks it as finished.
  void AddFile(int image, const std::string& file, const std::string& sha256);

 private:
  struct ImageFile {
    std::string file;
    std::string sha256;
  };

  std::ofstream list_;
  std::vector<int> images_;
  std::vector<std::string> files_, remarks_;
  int current_ = -1;
  std::vector<ImageFile> current_files_;
};

}  // namespace sightline
