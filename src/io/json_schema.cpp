// SPDX-License-Identifier: Apache-2.0
#include "io/json_schema.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

using Json = SchemaSource::Json;

/// Name of a field among its siblings. Names below any object's name ("front.x_m") become one name
/// for all objects ("*.x_m").
std::string general_name(const std::string& name) {
  const auto dot = name.rfind('.');
  return dot == std::string::npos ? name : "*" + name.substr(dot);
}

bool is_pattern(const std::string& name) { return name.starts_with("*."); }

bool contains(const Json& document, const std::string& pointer) {
  return document.contains(Json::json_pointer(pointer));
}

/// Whether all readings have the same bound. Bounds that differ depend on other parts of the
/// document.
template <typename Bound>
bool agree(const std::vector<Bound>& bounds) {
  return std::ranges::all_of(bounds, [&](const Bound& b) { return b == bounds.front(); });
}

Json bound_json(double bound, bool whole) {
  return whole ? Json(static_cast<std::int64_t>(bound)) : Json(bound);
}

Json number_schema(const std::vector<const JsonRecord*>& asked) {
  const bool whole = std::ranges::all_of(asked, [](const JsonRecord* r) { return r->whole; });
  std::vector<std::pair<double, bool>> lower, upper;
  for (const JsonRecord* r : asked) {
    lower.emplace_back(r->number->lower, r->number->above_lower);
    upper.emplace_back(r->number->upper, r->number->below_upper);
  }
  Json schema{{"type", whole ? "integer" : "number"}};
  if (agree(lower) && std::isfinite(lower[0].first)) {
    schema[lower[0].second ? "exclusiveMinimum" : "minimum"] = bound_json(lower[0].first, whole);
  }
  if (agree(upper) && std::isfinite(upper[0].first)) {
    schema[upper[0].second ? "exclusiveMaximum" : "maximum"] = bound_json(upper[0].first, whole);
  }
  return schema;
}

Json string_schema(const std::vector<const JsonRecord*>& asked) {
  Json words = Json::array();
  for (const JsonRecord* r : asked) {
    if (r->text) return {{"type", "string"}};
    for (const std::string& word : r->words) {
      if (std::ranges::find(words, Json(word)) == words.end()) words.push_back(word);
    }
  }
  return {{"enum", words}};
}

std::vector<std::string> names_of(const JsonRecord& record) {
  std::vector<std::string> names;
  for (const std::string& name : record.names) names.push_back(general_name(name));
  return names;
}

void add_names(std::vector<std::string>& names, const std::vector<std::string>& more) {
  for (const std::string& name : more) {
    if (std::ranges::find(names, name) == names.end()) names.push_back(name);
  }
}

std::string decider_of(const std::string& name, const JsonRecord& field) {
  return field.deciders.empty() ? name : field.deciders;
}

/// Adds a property to an object's schema. A name that is a pattern goes to the pattern properties.
void put_property(Json& schema, const std::string& name, Json value) {
  if (is_pattern(name)) {
    schema["patternProperties"]["^.+\\" + name.substr(1) + "$"] = std::move(value);
  } else {
    schema["properties"][name] = std::move(value);
  }
}

}  // namespace

void SchemaSource::add(Json example, const std::string& path) {
  auto added = std::make_shared<Example>(Example{std::move(example), path, {}});
  if (read_ == nullptr) {
    added->record.observe(added->document);
  } else {
    const JsonRecording recording(added->record, path);
    read_(added->document, path);
  }
  examples_.push_back(std::move(added));
}

Json SchemaSource::schema(const std::string& title) const {
  Places roots;
  for (const auto& example : examples_) roots.push_back({&example->record, example.get()});
  Json schema{{"$schema", "http://json-schema.org/draft-07/schema#"}, {"title", title}};
  Json own = describe(roots);
  own["properties"]["$schema"] = {{"type", "string"}};
  schema.update(own);
  return schema;
}

Json SchemaSource::describe(const Places& places) const {
  std::vector<const JsonRecord*> numbers, strings;
  Places arrays, objects;
  bool boolean = false, null = false;
  for (const Place& place : places) {
    const JsonRecord& r = *place.record;
    if (r.number) numbers.push_back(&r);
    if (r.text || !r.words.empty()) strings.push_back(&r);
    if (r.array) arrays.push_back(place);
    if (r.object) objects.push_back(place);
    boolean = boolean || r.boolean;
    null = null || r.type == Json::value_t::null;
  }
  // One object or a list of objects: both are read alike.
  const bool one_or_several = !objects.empty() && !arrays.empty();
  for (const Place& array : arrays) {
    for (const JsonRecord& element : array.record->elements) {
      if (one_or_several && element.object) objects.push_back({&element, array.example});
    }
  }
  Json forms = Json::array();
  if (!numbers.empty()) forms.push_back(number_schema(numbers));
  if (boolean) forms.push_back({{"type", "boolean"}});
  if (!strings.empty()) forms.push_back(string_schema(strings));
  if (!objects.empty()) forms.push_back(describe_object(objects));
  if (!arrays.empty())
    forms.push_back(describe_array(arrays, one_or_several ? forms.back() : Json()));
  if (null) forms.push_back({{"type", "null"}});
  if (forms.empty()) return Json::object();
  return forms.size() == 1 ? forms[0] : Json{{"anyOf", forms}};
}

Json SchemaSource::describe_array(const Places& places, Json items) const {
  Places elements;
  std::vector<std::optional<std::size_t>> sizes;
  std::size_t least = places.front().record->least;
  for (const Place& place : places) {
    sizes.push_back(place.record->size);
    least = std::min(least, place.record->size.value_or(place.record->least));
    for (const JsonRecord& e : place.record->elements) elements.push_back({&e, place.example});
  }
  Json schema{{"type", "array"}};
  const bool objects =
      std::ranges::any_of(elements, [](const Place& p) { return p.record->object; });
  if (!elements.empty()) schema["items"] = objects && !items.is_null() ? items : describe(elements);
  if (agree(sizes) && sizes.front()) {
    schema["minItems"] = *sizes.front();
    schema["maxItems"] = *sizes.front();
  } else if (least > 0) {
    schema["minItems"] = least;
  }
  return schema;
}

SchemaSource::Places SchemaSource::fields_of(const Places& places, const std::string& name) {
  Places fields;
  for (const Place& place : places) {
    for (const auto& [own, field] : place.record->fields) {
      if (name == "*" || general_name(own) == name) fields.push_back({&field, place.example});
    }
  }
  return fields;
}

std::vector<std::vector<SchemaSource::Variant>> SchemaSource::variants_of(const Places& places) {
  std::set<std::string> deciders;
  for (const Place& place : places) {
    for (const auto& [name, field] : place.record->fields) {
      if (!field.decides.empty()) deciders.insert(decider_of(name, field));
    }
  }
  std::vector<std::vector<Variant>> all;
  for (const std::string& decider : deciders) {
    std::map<std::map<std::string, std::string>, Places> variants;
    for (const Place& place : places) {
      std::map<std::string, std::string> decided;
      for (const auto& [name, field] : place.record->fields) {
        if (decider_of(name, field) == decider) decided[name] = field.decides;
      }
      variants[decided].push_back(place);
    }
    all.emplace_back();
    for (auto& [decided, where] : variants) all.back().push_back({decided, std::move(where)});
  }
  return all;
}

Json SchemaSource::describe_object(const Places& places) const {
  std::vector<std::string> names;
  for (const Place& place : places) add_names(names, names_of(*place.record));
  Json schema{{"type", "object"}};
  if (names.empty()) {
    if (const Places all = fields_of(places, "*"); !all.empty()) {
      schema["additionalProperties"] = describe(all);
    }
    return schema;
  }
  for (const std::string& name : names) {
    const Places fields = fields_of(places, name);
    Json description = describe(fields);
    const bool there =
        std::ranges::any_of(fields, [](const Place& p) { return p.record->type.has_value(); });
    if (description.empty() && !there) {
      if (is_pattern(name)) continue;
      throw Error(places.front().record->pointer + "/" + name, "is in no example");
    }
    put_property(schema, name, std::move(description));
  }
  schema["additionalProperties"] = false;
  const std::vector<std::string> always = required(places, names);
  if (!always.empty()) schema["required"] = always;
  const bool may_be_empty = accepts_any(places, [](Json& document, const Place& place) {
    document[Json::json_pointer(place.record->pointer)] = Json::object();
  });
  if (read_ != nullptr && always.empty() && !may_be_empty) schema["minProperties"] = 1;
  for (const std::vector<Variant>& variants : variants_of(places)) {
    Json alternatives = describe_variants(variants, names, always);
    if (!alternatives.empty()) schema["allOf"].push_back({{"anyOf", std::move(alternatives)}});
  }
  return schema;
}

Json SchemaSource::describe_variants(const std::vector<Variant>& variants,
                                     const std::vector<std::string>& names,
                                     const std::vector<std::string>& always) const {
  Json alternatives = Json::array();
  for (const Variant& variant : variants) {
    Json alternative = describe_variant(variant, names, always);
    if (alternative.empty()) return Json::array();  // this variant allows anything
    if (std::ranges::find(alternatives, alternative) == alternatives.end()) {
      alternatives.push_back(std::move(alternative));
    }
  }
  return alternatives;
}

Json SchemaSource::describe_variant(const Variant& variant, const std::vector<std::string>& names,
                                    const std::vector<std::string>& always) const {
  Json schema = Json::object();
  std::vector<std::string> needed = required(variant.places, names);
  for (const auto& [name, decided] : variant.decided) {
    if (decided == "absent") {
      put_property(schema, name, false);
      continue;
    }
    const bool stated = std::ranges::all_of(fields_of(variant.places, name), [](const Place& p) {
      return contains(p.example->document, p.record->pointer);
    });
    if (stated) add_names(needed, {name});
    if (decided != "there") put_property(schema, name, {{"const", Json::parse(decided)}});
  }
  std::vector<std::string> own;
  for (const Place& place : variant.places) add_names(own, names_of(*place.record));
  for (const std::string& name : names) {
    const Places fields = fields_of(variant.places, name);
    const bool forbidden = !fields.empty() && std::ranges::all_of(fields, [](const Place& p) {
      return p.record->forbidden;
    });
    const bool unknown = std::ranges::find(own, name) == own.end() && !is_pattern(name);
    if (forbidden || unknown) put_property(schema, name, false);
  }
  std::erase_if(needed, [&](const std::string& n) { return std::ranges::count(always, n) > 0; });
  if (!needed.empty()) schema["required"] = needed;
  for (const std::string& name : needed_choice(variant.places)) {
    if (variant.decided.contains(name)) break;  // stated already
    schema["anyOf"].push_back({{"required", {name}}});
  }
  return schema;
}

std::vector<std::string> SchemaSource::required(const Places& places,
                                                const std::vector<std::string>& names) const {
  // Objects that a preset states are not in the document.
  Places stated;
  for (const Place& place : places) {
    if (contains(place.example->document, place.record->pointer)) stated.push_back(place);
  }
  std::vector<std::string> list;
  for (const std::string& name : names) {
    if (!stated.empty() && !can_be_left_out(stated, name)) list.push_back(name);
  }
  return list;
}

bool SchemaSource::can_be_left_out(const Places& places, const std::string& name) const {
  if (is_pattern(name)) return true;
  for (const Place& place : places) {
    const JsonRecord* field = place.record->find(name);
    if (field == nullptr || !contains(place.example->document, field->pointer)) return true;
  }
  return accepts_any(places, [&](Json& document, const Place& place) {
    document[Json::json_pointer(place.record->pointer)].erase(name);
  });
}

bool SchemaSource::accepts_any(
    const Places& places,
    const std::function<void(Json& document, const Place& place)>& change) const {
  if (read_ == nullptr) return false;
  std::set<const Example*> tried;  // one place of each example
  for (const Place& place : places) {
    if (!tried.insert(place.example).second) continue;
    Json changed = place.example->document;
    change(changed, place);
    try {
      read_(changed, place.example->path);
      return true;
    } catch (const Error&) {  // refused with this change
    }
  }
  return false;
}

std::vector<std::string> SchemaSource::needed_choice(const Places& places) const {
  std::vector<std::string> names;
  const auto chosen = [](const Place& place) -> const JsonRecord* {
    for (const auto& [name, field] : place.record->fields) {
      if (field.deciders.empty() || field.decides != "there") continue;
      return contains(place.example->document, field.pointer) ? &field : nullptr;
    }
    return nullptr;
  };
  if (read_ == nullptr || !std::ranges::all_of(places, chosen)) return names;
  const bool open = accepts_any(places, [&](Json& document, const Place& place) {
    const Json::json_pointer pointer(chosen(place)->pointer);
    document[pointer.parent_pointer()].erase(pointer.back());
  });
  if (open) return names;
  for (const auto& [name, field] : places.front().record->fields) {
    if (!field.deciders.empty()) names.push_back(name);
  }
  return names;
}

Json patch_schema(Json schema) {
  for (const char* key : {"required", "allOf", "minProperties"}) schema.erase(key);
  for (const char* key : {"properties", "patternProperties"}) {
    if (!schema.contains(key)) continue;
    for (Json& value : schema[key]) {
      value = Json{{"anyOf", {patch_schema(value), {{"type", "null"}}}}};
    }
  }
  if (schema.contains("anyOf")) {
    for (Json& form : schema["anyOf"]) form = patch_schema(form);
  }
  return schema;
}

}  // namespace blindcorner
