// SPDX-License-Identifier: Apache-2.0
// Recipes, uploads, and which files are still named.
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/job_store/job_checks.h"
#include "planning_service/job_store/job_rows.h"
#include "planning_service/job_store/plain_text.h"
#include "planning_service/job_store/sql_job_store_impl.h"
#include "proto/status/rpc_status.h"

namespace sightline {

absl::StatusOr<Recipe> SqlJobStore::GetRecipe(const std::string& client,
                                              const std::string& recipe_id) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"client", client}, {"recipe_id", recipe_id}}, {}));
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<Recipe> {
    const SqlRows rows =
        sql.Run("SELECT kind, fingerprint, task FROM recipe WHERE client = $1 AND recipe_id = $2",
                {client, recipe_id});
    if (rows.empty()) {
      return WithErrorInfo(absl::NotFoundError(absl::StrCat("no recipe \"", recipe_id, "\"")),
                           "RECIPE_UNKNOWN");
    }
    return Recipe{client,
                  recipe_id,
                  rows.front().Text(0),
                  rows.front().Text(1),
                  rows.front().Bytes(2),
                  FilesOf(sql, {client, "recipe", recipe_id})};
  });
}

absl::Status SqlJobStore::PutRecipe(const Recipe& recipe, const ClientQuota& quota) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"client", recipe.client},
                                             {"recipe_id", recipe.recipe_id},
                                             {"kind", recipe.kind},
                                             {"fingerprint", recipe.fingerprint}},
                                            recipe.files));
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("DELETE FROM recipe WHERE client = $1 AND recipe_id = $2",
            {recipe.client, recipe.recipe_id});
    sql.Run(
        "INSERT INTO recipe (client, recipe_id, kind, fingerprint, task)"
        " VALUES ($1, $2, $3, $4, $5)",
        {recipe.client, recipe.recipe_id, recipe.kind, recipe.fingerprint, SqlBytes{recipe.task}});
    ReplaceFiles(sql, {recipe.client, "recipe", recipe.recipe_id}, recipe.files);
    return CheckStoredBytes(sql, recipe.client, quota);
  });
}

absl::Status SqlJobStore::DeleteRecipe(const std::string& client, const std::string& recipe_id) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"client", client}, {"recipe_id", recipe_id}}, {}));
  return Write([&](SqlTransaction& sql) -> absl::Status {
    sql.Run("DELETE FROM recipe WHERE client = $1 AND recipe_id = $2", {client, recipe_id});
    ReplaceFiles(sql, {client, "recipe", recipe_id}, {});
    return absl::OkStatus();
  });
}

absl::StatusOr<int> SqlJobStore::CountRecipes(const std::string& client) {
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<int> {
    const SqlRows rows = sql.Run("SELECT COUNT(*) FROM recipe WHERE client = $1", {client});
    return rows.empty() ? 0 : static_cast<int>(rows.front().Int(0));
  });
}

absl::Status SqlJobStore::AddUpload(const std::string& client, const JobFile& file,
                                    const ClientQuota& quota) {
  SIGHTLINE_RETURN_IF_ERROR(CheckPlainNames({{"client", client}}, {file}));
  return Write([&](SqlTransaction& sql) -> absl::Status {
    const bool held = !sql.Run("SELECT 1 FROM named_file WHERE client = $1 AND digest = $2 LIMIT 1",
                               {client, file.digest})
                           .empty();
    ReplaceFiles(sql, {client, "upload", file.digest}, {file});
    // A file that the client holds already takes no more room.
    return held ? absl::OkStatus() : CheckStoredBytes(sql, client, quota);
  });
}

absl::StatusOr<std::optional<int64_t>> SqlJobStore::FindFile(const std::string& client,
                                                             const std::string& digest) {
  if (!IsPlainText(client) || !IsPlainText(digest)) return std::nullopt;
  return Read([&](SqlTransaction& sql) -> absl::StatusOr<std::optional<int64_t>> {
    const SqlRows rows =
        sql.Run("SELECT size_bytes FROM named_file WHERE client = $1 AND digest = $2 LIMIT 1",
                {client, digest});
    if (rows.empty()) return std::nullopt;
    return rows.front().Int(0);
  });
}

absl::StatusOr<std::set<std::string>> SqlJobStore::NamedDigests() {
  return Read([](SqlTransaction& sql) -> absl::StatusOr<std::set<std::string>> {
    std::set<std::string> digests;
    for (const SqlRow& row : sql.Run("SELECT DISTINCT digest FROM named_file")) {
      digests.insert(row.Text(0));
    }
    return digests;
  });
}

}  // namespace sightline
