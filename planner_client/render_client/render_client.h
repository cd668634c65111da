// Client of a render worker: one request, its files into a folder.
#pragma once

#include <atomic>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planner_client/embedded_server/embedded_server.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

struct RenderClientOptions {
  // "unix:PATH" or "HOST:PORT". Not used with an embedded worker.
  std::string address;
  // Must outlive the call. May be null.
  EmbeddedServer* embedded = nullptr;
  // PEM texts. Root certificates turn on TLS; certificate and key are for mTLS.
  std::string tls_root_certificates;
  std::string tls_certificate;
  std::string tls_key;
  // Longest time of the whole render.
  absl::Duration render_timeout = absl::Hours(24);
  // UNAVAILABLE before the job was created is tried again for at most this long. Later it is an
  // error: a worker that ended has lost the job.
  absl::Duration retry_for = absl::Seconds(10);
  std::function<void(double progress, const std::string& message)> on_progress;
  std::function<void(const std::string& warning)> on_warning;
  // Cancels the job when it becomes true. May be null.
  const std::atomic<bool>* interrupted = nullptr;
};

// A file that goes with the request.
struct RenderAssetFile {
  std::string file;  // as it stands in the request
  std::string bytes;
};

// Uploads what the worker does not know, renders, and writes every file into `folder` once it is
// complete and its digest is right: under another name first, then renamed. recordings.json comes
// last, so that a folder that has one has all its images. Returns the files' names. UNAVAILABLE:
// the worker ended; the message says how. CANCELLED: interrupted. Other errors are the worker's.
absl::StatusOr<std::vector<std::string>> RenderToFolder(const RenderClientOptions& options,
                                                        v1::RenderSpec spec,
                                                        const std::vector<RenderAssetFile>& assets,
                                                        const std::string& folder);

}  // namespace sightline
