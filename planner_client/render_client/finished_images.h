// SPDX-License-Identifier: Apache-2.0
// Images of a request that are in a folder already, from which an interrupted rendering goes on.
#pragma once

#include <fstream>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

// A list of finished images in a file, a line of JSON each, under the digest of the request that
// they answer and of the worker that made them.
class FinishedImages {
 public:
  // Reads the list at `file`, and those of others beside it, whose names begin like it; it is
  // written anew. Entries of another request, of a worker of another build (`worker_build`:
  // GetRenderWorkerResponse.server_build) or damaged ones do not count, nor do images whose files
  // are not in `folder` any more or have other bytes. INTERNAL: the file cannot be written.
  static absl::StatusOr<FinishedImages> Open(const std::string& file, const std::string& folder,
                                             const v1::RenderSpec& spec,
                                             const std::string& worker_build);

  // Numbers of finished images, ascending.
  const std::vector<int>& images() const { return images_; }
  // Their files.
  const std::vector<std::string>& files() const { return files_; }
  // A sentence on every list that does not count, and on every image of the others that is not
  // whole any more.
  const std::vector<std::string>& remarks() const { return remarks_; }

  // A file that is complete in the folder. All files of an image come one after the other; the next
  // image's first one, or one of image -1, says that it is finished.
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
