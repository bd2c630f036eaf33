// SPDX-License-Identifier: Apache-2.0
/// Records what a reader asks of the values of a document while it reads them. The JSON schemas
/// (json_schema.h) are made from these records, so that fields, types and ranges stand in one
/// place, the readers.
#pragma once

#include <cstddef>
#include <list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "forward/support/number_range.h"

namespace blindcorner {

/// One value of a document, or a field that is not there, and what was asked of it.
struct JsonRecord {
  using Json = nlohmann::ordered_json;

  std::string pointer;                ///< JSON pointer into the document
  std::optional<Json::value_t> type;  ///< as it was read; empty: absent

  std::optional<NumberRange> number;
  bool whole = false;  ///< the number is a whole one
  bool boolean = false, text = false;
  std::vector<std::string> words;  ///< the accepted words

  bool array = false;
  std::size_t least = 0;            ///< fewest elements
  std::optional<std::size_t> size;  ///< exact number of elements
  std::list<JsonRecord> elements;   ///< a list, because readers keep pointers to its items

  bool object = false;
  std::vector<std::string> names;  ///< fields that may be there; empty: any
  std::list<std::pair<std::string, JsonRecord>> fields;

  /// For a field that decides which other fields may or must stand beside it. If its word decides:
  /// the word that holds, as JSON in quotes (a default for an absent field). If its presence
  /// decides: there or absent. Empty: nothing depends on the field.
  std::string decides;
  std::string deciders;    ///< which fields decide together; empty: this one alone
  bool forbidden = false;  ///< the fields beside it exclude this one

  JsonRecord& field(std::string_view name, const Json* value);
  JsonRecord& element(std::size_t index, const Json* value);
  const JsonRecord* find(std::string_view name) const;

  /// Records what a reader of this content would ask. For documents that are only written.
  void observe(const Json& content);
};

/// While it lives, readers of that file on this thread record what they ask.
class JsonRecording {
 public:
  JsonRecording(JsonRecord& root, std::string file);
  ~JsonRecording();
  JsonRecording(const JsonRecording&) = delete;
  JsonRecording& operator=(const JsonRecording&) = delete;

  /// Where the reader of this file records; null: nowhere.
  static JsonRecord* root_for(const std::string& file);

 private:
  JsonRecord& root_;
  std::string file_;
};

}  // namespace blindcorner
