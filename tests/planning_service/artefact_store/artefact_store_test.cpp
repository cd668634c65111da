// SPDX-License-Identifier: Apache-2.0
#include "planning_service/artefact_store/artefact_store.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <system_error>
#include <thread>

#include "absl/strings/str_cat.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

// SHA-256 of "abc", from FIPS 180-2, and of nothing.
constexpr char kAbc[] = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
constexpr char kNothing[] = "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855";

std::string Bytes(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  EXPECT_TRUE(stream.good()) << path;
  return std::string(std::istreambuf_iterator<char>(stream), {});
}

void WriteBytes(const std::string& path, const std::string& bytes) {
  fs::remove(path);
  std::ofstream(path, std::ios::binary) << bytes;
}

ino_t Inode(const std::string& path) {
  struct stat info {};
  EXPECT_EQ(stat(path.c_str(), &info), 0) << path;
  return info.st_ino;
}

// Makes a file `age` older than it is.
void MakeOld(const std::string& path, absl::Duration age) {
  struct stat info {};
  ASSERT_EQ(stat(path.c_str(), &info), 0) << path;
  const timespec time = absl::ToTimespec(absl::TimeFromTimespec(info.st_mtim) - age);
  const timespec times[] = {time, time};
  ASSERT_EQ(utimensat(AT_FDCWD, path.c_str(), times, 0), 0) << path;
}

class ArtefactStoreTest : public testing::Test {
 protected:
  ArtefactStoreTest() {
    if (mkdtemp(folder_.data()) == nullptr) std::abort();
    files_ = folder_ + "/deep/files";
    store_ = Open();
  }
  ~ArtefactStoreTest() override {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }

  std::unique_ptr<ArtefactStore> Open(int64_t reserve_bytes = 0) {
    auto store = ArtefactStore::Open(files_, reserve_bytes);
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }

  std::string Put(const std::string& bytes) {
    const auto writer = store_->NewFile();
    EXPECT_TRUE(writer.ok()) << writer.status();
    EXPECT_TRUE((*writer)->Write(bytes).ok());
    const auto digest = (*writer)->Commit("");
    EXPECT_TRUE(digest.ok()) << digest.status();
    return digest.value_or("");
  }

  std::vector<std::string> Incoming() const {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(files_ + "/incoming")) {
      names.push_back(entry.path().filename());
    }
    return names;
  }

  std::string folder_ = "/tmp/sightline_artefacts_XXXXXX";
  std::string files_;
  std::unique_ptr<ArtefactStore> store_;
};

TEST_F(ArtefactStoreTest, KeepsFilesByDigest) {
  const auto writer = store_->NewFile();
  ASSERT_TRUE(writer.ok()) << writer.status();
  ASSERT_TRUE((*writer)->Write("a").ok());
  ASSERT_TRUE((*writer)->Write("").ok());
  ASSERT_TRUE((*writer)->Write("bc").ok());
  EXPECT_EQ((*writer)->size_bytes(), 3);
  EXPECT_FALSE(store_->Has(kAbc));  // not yet
  const auto digest = (*writer)->Commit(kAbc);
  ASSERT_TRUE(digest.ok()) << digest.status();
  EXPECT_EQ(*digest, kAbc);
  EXPECT_TRUE(absl::IsFailedPrecondition((*writer)->Write("d")));
  EXPECT_TRUE(absl::IsFailedPrecondition((*writer)->Commit("").status()));

  store_ = Open();
  EXPECT_TRUE(store_->Has(kAbc));
  EXPECT_EQ(*store_->Path(kAbc), absl::StrCat(files_, "/ba/", kAbc));
  EXPECT_EQ(Bytes(*store_->Path(kAbc)), "abc");
  EXPECT_EQ(fs::status(*store_->Path(kAbc)).permissions(), fs::perms::owner_read);
  EXPECT_EQ(Put(""), kNothing);
  EXPECT_EQ(*store_->Read(kNothing, 0, 10), "");
  EXPECT_THAT(Incoming(), IsEmpty());
}

TEST_F(ArtefactStoreTest, RefusesAnotherDigest) {
  for (const std::string& expected : {std::string(kNothing), std::string("ABC")}) {
    const auto writer = store_->NewFile();
    ASSERT_TRUE((*writer)->Write("abc").ok());
    const absl::Status refused = (*writer)->Commit(expected).status();
    EXPECT_TRUE(absl::IsInvalidArgument(refused)) << refused;
    EXPECT_EQ(ErrorReason(refused), "DIGEST_MISMATCH");
    EXPECT_THAT(refused.message(), HasSubstr(kAbc));
    EXPECT_FALSE((*writer)->Commit("").ok());
  }
  EXPECT_FALSE(store_->Has(kAbc));
  EXPECT_THAT(Incoming(), IsEmpty());
}

TEST_F(ArtefactStoreTest, WhatIsNotCommittedGoes) {
  {
    const auto writer = store_->NewFile();
    ASSERT_TRUE((*writer)->Write("abc").ok());
    EXPECT_THAT(Incoming(), SizeIs(1));
  }
  EXPECT_THAT(Incoming(), IsEmpty());
  EXPECT_FALSE(store_->Has(kAbc));
}

TEST_F(ArtefactStoreTest, DigestsThatAreNoneAreNotFound) {
  WriteBytes(folder_ + "/secret", "s");
  for (const std::string& bad :
       {std::string(), std::string("../../secret"), std::string(64, 'A'), std::string(63, 'a'),
        std::string(65, 'a'), std::string(63, 'a') + "/", std::string(64, '.'),
        std::string(63, 'a') + std::string(1, '\0'), std::string(64, 'g'),
        "../" + std::string(58, '/') + "abc"}) {
    EXPECT_FALSE(store_->Has(bad));
    EXPECT_TRUE(absl::IsNotFound(store_->Path(bad).status()));
    EXPECT_TRUE(absl::IsNotFound(store_->Read(bad, 0, 1).status()));
    EXPECT_TRUE(absl::IsNotFound(store_->Materialise(bad, folder_ + "/out")));
  }
  EXPECT_TRUE(absl::IsNotFound(store_->Path(std::string(64, 'a')).status()));
  EXPECT_FALSE(fs::exists(folder_ + "/out"));
}

TEST_F(ArtefactStoreTest, ReadsPieces) {
  Put("abc");
  EXPECT_EQ(*store_->Read(kAbc, 0, 2), "ab");
  EXPECT_EQ(*store_->Read(kAbc, 2, 100), "c");
  EXPECT_EQ(*store_->Read(kAbc, 3, 100), "");
  EXPECT_EQ(*store_->Read(kAbc, int64_t{1} << 62, int64_t{1} << 62), "");
  EXPECT_EQ(*store_->Read(kAbc, 0, 0), "");
  EXPECT_TRUE(absl::IsInvalidArgument(store_->Read(kAbc, -1, 1).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(store_->Read(kAbc, 0, -1).status()));
}

TEST_F(ArtefactStoreTest, AddsACopyThatTheJobCannotChange) {
  const std::string path = folder_ + "/result";
  WriteBytes(path, "abc");
  const auto added = store_->AddFile(path);
  ASSERT_TRUE(added.ok()) << added.status();
  EXPECT_EQ(added->digest, kAbc);
  EXPECT_EQ(added->size_bytes, 3);
  EXPECT_NE(Inode(path), Inode(*store_->Path(kAbc)));
  std::ofstream(path, std::ios::in | std::ios::out) << "xyz";
  EXPECT_EQ(Bytes(*store_->Path(kAbc)), "abc");
  EXPECT_EQ(Bytes(path), "xyz");
}

TEST_F(ArtefactStoreTest, AddsLargeFilesWhole) {
  std::string bytes;
  for (int i = 0; bytes.size() < (3u << 20) + 17; ++i) absl::StrAppend(&bytes, i, ",");
  WriteBytes(folder_ + "/large", bytes);
  const auto added = store_->AddFile(folder_ + "/large");
  ASSERT_TRUE(added.ok()) << added.status();
  EXPECT_EQ(added->size_bytes, static_cast<int64_t>(bytes.size()));
  EXPECT_EQ(added->digest, Put(bytes));
  ASSERT_TRUE(store_->Materialise(added->digest, folder_ + "/copy").ok());
  EXPECT_EQ(Bytes(folder_ + "/copy"), bytes);
}

TEST_F(ArtefactStoreTest, AddsRegularFilesOnly) {
  EXPECT_TRUE(absl::IsNotFound(store_->AddFile(folder_ + "/none").status()));
  EXPECT_TRUE(absl::IsInvalidArgument(store_->AddFile(folder_).status()));
  WriteBytes(folder_ + "/secret", "s");
  fs::create_symlink(folder_ + "/secret", folder_ + "/link");
  EXPECT_TRUE(absl::IsInvalidArgument(store_->AddFile(folder_ + "/link").status()));
  ASSERT_EQ(mkfifo((folder_ + "/pipe").c_str(), 0600), 0);
  EXPECT_TRUE(absl::IsInvalidArgument(store_->AddFile(folder_ + "/pipe").status()));
  EXPECT_THAT(Incoming(), IsEmpty());
}

TEST_F(ArtefactStoreTest, MaterialisesACopy) {
  Put("abc");
  const std::string path = folder_ + "/job/sub/part.stl";
  ASSERT_TRUE(store_->Materialise(kAbc, path).ok());
  EXPECT_EQ(Bytes(path), "abc");
  EXPECT_NE(Inode(path), Inode(*store_->Path(kAbc)));
  // A file that an earlier attempt left is replaced.
  WriteBytes(path, "half");
  ASSERT_TRUE(store_->Materialise(kAbc, path).ok());
  EXPECT_EQ(Bytes(path), "abc");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ + "/job/sub"), {}), 1);
  EXPECT_FALSE(store_->Materialise(kAbc, path + "/below-a-file").ok());
}

TEST_F(ArtefactStoreTest, TellsOfDamageAndMendsIt) {
  Put("abc");
  const std::string path = *store_->Path(kAbc);
  WriteBytes(path, "abd");
  const absl::Status damaged = store_->Materialise(kAbc, folder_ + "/job/part.stl");
  EXPECT_TRUE(absl::IsDataLoss(damaged)) << damaged;
  EXPECT_THAT(damaged.message(), HasSubstr(kAbc));
  EXPECT_THAT(fs::directory_iterator(folder_ + "/job"), fs::directory_iterator());
  Put("abc");
  EXPECT_TRUE(store_->Materialise(kAbc, folder_ + "/job/part.stl").ok());
}

TEST_F(ArtefactStoreTest, RemovesWhatNobodyNamesAndIsOld) {
  const std::string kept = Put("kept"), old = Put("old one"), young = Put("young");
  for (const std::string& digest : {kept, old}) MakeOld(*store_->Path(digest), absl::Hours(2));
  WriteBytes(files_ + "/ba", "");  // nobody's business
  const auto freed = store_->RemoveAllBut({kept}, absl::Hours(1));
  ASSERT_TRUE(freed.ok()) << freed.status();
  EXPECT_EQ(*freed, 7);
  EXPECT_TRUE(store_->Has(kept));
  EXPECT_TRUE(store_->Has(young));
  EXPECT_FALSE(store_->Has(old));
  EXPECT_EQ(*store_->RemoveAllBut({kept}, absl::ZeroDuration()), 5);
  EXPECT_TRUE(store_->Has(kept));
}

TEST_F(ArtefactStoreTest, FileThatCameAgainIsYoung) {
  const std::string digest = Put("abc");
  MakeOld(*store_->Path(digest), absl::Hours(2));
  Put("abc");
  EXPECT_EQ(*store_->RemoveAllBut({}, absl::Hours(1)), 0);
  MakeOld(*store_->Path(digest), absl::Hours(2));
  WriteBytes(folder_ + "/file", "abc");
  ASSERT_TRUE(store_->AddFile(folder_ + "/file").ok());
  EXPECT_EQ(*store_->RemoveAllBut({}, absl::Hours(1)), 0);
  EXPECT_TRUE(store_->Has(digest));
}

// A file that has just come in is never removed for the age of the one before it.
TEST_F(ArtefactStoreTest, RemovingAndAddingDoNotMeet) {
  const auto other = Open();
  std::atomic<bool> done = false;
  std::thread remover([&] {
    while (!done) EXPECT_TRUE(other->RemoveAllBut({}, absl::Hours(1)).ok());
  });
  for (int i = 0; i < 300; ++i) {
    const std::string digest = Put("abc");
    ASSERT_TRUE(store_->Has(digest)) << i;
    MakeOld(*store_->Path(digest), absl::Hours(2));
  }
  done = true;
  remover.join();
}

TEST_F(ArtefactStoreTest, OpenRemovesOldRemainsOfOtherProcesses) {
  int ready[2];
  ASSERT_EQ(pipe(ready), 0);
  const pid_t child = fork();
  if (child == 0) {
    const auto writer = store_->NewFile();
    if (writer.ok() && (*writer)->Write("abc").ok() && write(ready[1], "x", 1) == 1) pause();
    _exit(1);
  }
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(ready[0]);
  close(ready[1]);

  store_ = Open();
  ASSERT_THAT(Incoming(), SizeIs(1));  // may be on its way yet
  const std::string path = files_ + "/incoming/" + Incoming()[0];
  MakeOld(path, absl::Hours(23));
  store_ = Open();
  ASSERT_THAT(Incoming(), SizeIs(1));
  MakeOld(path, absl::Hours(2));
  store_ = Open();
  EXPECT_THAT(Incoming(), IsEmpty());
}

TEST_F(ArtefactStoreTest, KeepsItsReserveFree) {
  EXPECT_TRUE(store_->HasRoom());
  Put("abc");
  const auto started = Open(int64_t{1} << 60);
  EXPECT_FALSE(started->HasRoom());
  const absl::Status full = started->NewFile().status();
  EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
  EXPECT_EQ(ErrorReason(full), "DISK_FULL");
  WriteBytes(folder_ + "/result", "abc");
  EXPECT_EQ(ErrorReason(started->AddFile(folder_ + "/result").status()), "DISK_FULL");
  EXPECT_EQ(*started->Read(kAbc, 0, 3), "abc");
}

TEST_F(ArtefactStoreTest, TellsWhyItCannotOpen) {
  WriteBytes(folder_ + "/file", "");
  for (const std::string& bad : {folder_ + "/file", folder_ + "/file/below"}) {
    const absl::Status status = ArtefactStore::Open(bad, 0).status();
    EXPECT_FALSE(status.ok());
    EXPECT_THAT(status.message(), HasSubstr(bad));
  }
}

TEST_F(ArtefactStoreTest, GoesOnOnceAFullDiskHasRoom) {
  const std::string disk = folder_ + "/disk";
  ASSERT_EQ(mkdir(disk.c_str(), 0777), 0);
  if (mount("none", disk.c_str(), "tmpfs", 0, "size=1m") != 0) GTEST_SKIP() << "may not mount";
  struct Unmount {
    std::string path;
    ~Unmount() { umount2(path.c_str(), MNT_DETACH); }
  } const unmount{disk};
  files_ = disk + "/files";
  store_ = Open();
  const std::string first = Put(std::string(600 << 10, 'a'));
  MakeOld(*store_->Path(first), absl::Hours(2));
  const std::string large(600 << 10, 'b');
  {
    const auto writer = store_->NewFile();
    ASSERT_TRUE(writer.ok()) << writer.status();
    const absl::Status full = (*writer)->Write(large);
    EXPECT_TRUE(absl::IsResourceExhausted(full)) << full;
    EXPECT_EQ(ErrorReason(full), "DISK_FULL");
    EXPECT_EQ(ErrorReason((*writer)->Commit("").status()), "DISK_FULL");
  }
  EXPECT_THAT(Incoming(), IsEmpty());
  WriteBytes(folder_ + "/result", large);
  EXPECT_EQ(ErrorReason(store_->AddFile(folder_ + "/result").status()), "DISK_FULL");
  EXPECT_EQ(ErrorReason(store_->Materialise(first, disk + "/job/part")), "DISK_FULL");
  EXPECT_THAT(fs::directory_iterator(disk + "/job"), fs::directory_iterator());
  EXPECT_EQ(*store_->Read(first, 0, 1), "a");

  // A disk without a byte left can be cleared.
  {
    std::ofstream filler(disk + "/filler", std::ios::binary);
    while (filler.write(large.data(), 4096) && filler.flush()) {
    }
  }
  EXPECT_FALSE(store_->HasRoom());
  store_ = Open();
  EXPECT_EQ(*store_->RemoveAllBut({}, absl::Hours(1)), 600 << 10);
  WriteBytes(folder_ + "/result", std::string(500 << 10, 'b'));
  const auto added = store_->AddFile(folder_ + "/result");
  EXPECT_TRUE(added.ok()) << added.status();
}

}  // namespace
}  // namespace sightline
