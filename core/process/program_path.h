// SPDX-License-Identifier: Apache-2.0
// Finds the programs of this product. They stand beside each other in a build folder, and in
// PREFIX/bin and PREFIX/libexec/sightline once they are installed.
#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

namespace sightline {

// Path of the running executable, links resolved; empty if the kernel does not say.
std::filesystem::path OwnProgram();

// The folders that may hold programs of this product, for the executable `own`: its own folder
// first, then PREFIX/bin and PREFIX/libexec/sightline if its own folder is one of these two.
std::vector<std::filesystem::path> ProgramFolders(const std::filesystem::path& own);

// The first executable file `name` in the folders of the running program. If there is none, the
// path at which it was looked for first, which does not exist: messages name it. PATH and the
// working folder are never searched, since any user who may write there could replace a program.
std::filesystem::path FindProgram(std::string_view name);

// PREFIX/share/sightline of an installed program, which holds examples and the catalogue. A build
// folder has none; the path then does not exist.
std::filesystem::path InstalledDataFolder();

}  // namespace sightline
