"""Users, moods and knowledge: programs' data on people, in a simulation without people."""

from typing import Any

from pepper_drake.robot_server.services.waiting import Module

_NOBODY = -1
"""`ALUserSession.getFocusedUser` when no user is with the robot."""

_UNKNOWN = (0.0, 0.0)
"""An unknown value, with zero confidence."""


class UserSession(Module):
    """ALUserSession: nobody is with the robot, and it knows no users."""

    def __init__(self) -> None:
        super().__init__("ALUserSession")

    def get_focused_user(self) -> int:
        """Returns the focused user: none."""
        return _NOBODY

    def _none(self, *_: Any) -> list[Any]:
        """Returns an empty list: there are no users."""
        return []

    get_user_list = _none
    get_open_user_sessions = _none
    get_permanent_user_list = _none
    find_users_with_binding = _none
    get_binding_list = _none
    get_binding_sources = _none
    get_user_data_sources = _none

    def _is_not(self, *_: Any) -> bool:
        """Returns False: the robot knows no user."""
        return False

    does_user_exist = _is_not
    do_users_exist = _is_not
    is_user_session_open = _is_not
    are_user_sessions_open = _is_not
    is_user_permanent = _is_not
    are_users_permanent = _is_not
    does_binding_exist = _is_not
    does_binding_source_exist = _is_not
    does_user_data_source_exist = _is_not

    def get_num_users(self) -> int:
        """Returns the number of known users: none."""
        return 0

    def get_num_open_sessions(self) -> int:
        """Returns the number of open sessions: none."""
        return 0

    def get_usid_from_ppid(self, _person: int) -> int:
        """Returns the user of a perceived person: none."""
        return _NOBODY

    def get_ppid_from_usid(self, _user: int) -> int:
        """Returns the perceived person of a user: none."""
        return _NOBODY

    def _unknown(self, user: int, *_: Any) -> Any:
        """Refuses: no user is known."""
        raise ValueError(f"there is no user {user}")

    get_user_binding = _unknown
    get_user_bindings = _unknown
    get_user_data = _unknown
    set_user_data = _unknown
    get_user_creation_date = _unknown
    get_first_encounter_date = _unknown
    get_current_encounter_date = _unknown
    get_last_encounter_date = _unknown
    get_seconds_since_last_encounter = _unknown


class UserInfo(Module):
    """ALUserInfo: programs' data of a user by domain and key.

    Methods without a user's number refer to the focused user, of whom there is none.
    """

    def __init__(self) -> None:
        super().__init__("ALUserInfo")
        self._values: dict[tuple[str, int, str], Any] = {}

    def get(self, *where: Any) -> Any:
        """Returns a value by (domain, user, key), None if there is none."""
        return self._values.get(_user_key(where))

    def set(self, *where_and_value: Any) -> bool:
        """Stores a value by (domain, user, key); returns whether a user is given."""
        *where, value = where_and_value
        key = _user_key(where)
        if key[1] == _NOBODY:
            return False
        self._values[key] = value
        self._emit("userInfoEdited", key[1], key[2], value)
        return True

    def has(self, *where: Any) -> bool:
        """Returns whether there is a value by (domain, user, key)."""
        return _user_key(where) in self._values

    def remove(self, *where: Any) -> bool:
        """Removes a value by (domain, user, key); returns whether there was one."""
        key = _user_key(where)
        if key not in self._values:
            return False
        del self._values[key]
        self._emit("userInfoRemoved", key[1], key[2])
        return True

    def remove_user(self, domain: str, user: int = _NOBODY) -> bool:
        """Removes a domain's data of a user; returns whether there was any."""
        gone = [key for key in self._values if key[:2] == (domain, user)]
        for key in gone:
            del self._values[key]
        return bool(gone)

    def get_type(self, domain: str, key: str) -> str:
        """Refuses: there is no focused user."""
        raise ValueError(f"nobody is with the robot, and {domain} keeps no {key}")


def _user_key(where: Any) -> tuple[str, int, str]:
    """Returns domain, user and key from any form of a method's arguments."""
    user = next((part for part in where if isinstance(part, int)), _NOBODY)
    texts = [part for part in where if isinstance(part, str)]
    return (texts[0] if len(texts) > 1 else "", user, texts[-1])


class Knowledge(Module):
    """ALKnowledge: triplets of subject, predicate and object by domain, until the robot ends."""

    def __init__(self) -> None:
        super().__init__("ALKnowledge")
        self._triplets: dict[tuple[str, str, str, str], None] = {}

    def add(self, domain: str, subject: str, predicate: str, value: str) -> None:
        """Adds a triplet."""
        self._triplets[domain, subject, predicate, value] = None
        self._emit("knowledgeAdded", domain, subject, predicate, value)

    def remove(self, domain: str, subject: str, predicate: str, value: str) -> None:
        """Removes a triplet."""
        triplet = (domain, subject, predicate, value)
        if triplet in self._triplets:
            del self._triplets[triplet]
            self._emit("knowledgeRemoved", *triplet)

    def update(self, domain: str, subject: str, predicate: str, value: str) -> None:
        """Replaces the objects of a subject and a predicate."""
        for old in self.get_object(domain, subject, predicate):
            self.remove(domain, subject, predicate, old)
        self.add(domain, subject, predicate, value)

    def contains(self, domain: str, subject: str, predicate: str, value: str) -> bool:
        """Returns whether a triplet is there."""
        return (domain, subject, predicate, value) in self._triplets

    def get_subject(self, domain: str, predicate: str, value: str) -> list[str]:
        """Returns the subjects of a predicate and an object."""
        return self._matching(domain, None, predicate, value, 1)

    def get_predicate(self, domain: str, subject: str, value: str) -> list[str]:
        """Returns the predicates of a subject and an object."""
        return self._matching(domain, subject, None, value, 2)

    def get_object(self, domain: str, subject: str, predicate: str) -> list[str]:
        """Returns the objects of a subject and a predicate."""
        return self._matching(domain, subject, predicate, None, 3)

    def query(self, domain: str, subject: str, predicate: str, value: str, *_: str) -> list[str]:
        """Returns the matches of the one of the three that is "?"."""
        asked = [subject, predicate, value]
        if asked.count("?") != 1:
            raise ValueError('one of subject, predicate and object must be "?"')
        first, second, third = (None if part == "?" else part for part in asked)
        return self._matching(domain, first, second, third, 1 + asked.index("?"))

    def query_triplet(
        self, domain: str, subject: str, predicate: str, value: str
    ) -> list[list[str]]:
        """Returns the matching triplets; "?" matches all."""
        asked = (subject, predicate, value)
        return [
            list(triplet[1:])
            for triplet in self._triplets
            if triplet[0] == domain
            and all(a in ("?", t) for a, t in zip(asked, triplet[1:], strict=True))
        ]

    def reset_knowledge(self, domain: str) -> None:
        """Removes a domain."""
        for triplet in [triplet for triplet in self._triplets if triplet[0] == domain]:
            self.remove(*triplet)

    def _matching(
        self, domain: str, subject: str | None, predicate: str | None, value: str | None, part: int
    ) -> list[str]:
        asked = (domain, subject, predicate, value)
        return [
            triplet[part]
            for triplet in self._triplets
            if all(a is None or a == t for a, t in zip(asked, triplet, strict=True))
        ]


class Mood(Module):
    """ALMood: without people every mood is unknown, with zero confidence."""

    def __init__(self) -> None:
        super().__init__("ALMood")
        self._subscribers: dict[str, str] = {}

    def subscribe(self, name: str, mode: str) -> bool:
        """Adds a subscriber."""
        self._subscribers[name] = mode
        return True

    def unsubscribe(self, name: str) -> bool:
        """Removes a subscriber; returns whether it was subscribed."""
        return self._subscribers.pop(name, None) is not None

    def get_subscribers_info(self) -> dict[str, str]:
        """Returns the subscribers with their modes."""
        return dict(self._subscribers)

    def _person(self, _person: int = 0) -> tuple[Any, ...]:
        """Returns valence, attention, body language, smile, expressions: all unknown."""
        return (_UNKNOWN, _UNKNOWN, (_UNKNOWN,), _UNKNOWN, (_UNKNOWN,) * 7)

    current_person_state = _person
    person_state_from_people_perception = _person
    person_state_from_user_session = _person

    def person_descriptor_from_people_perception(self, person: int) -> tuple[int, int]:
        """Refuses: nobody is seen."""
        raise ValueError(f"there is no person {person}")

    def persons(self) -> list[Any]:
        """Returns the persons: none."""
        return []

    def ambiance_state(self) -> tuple[float, float]:
        """Returns agitation and calm, from 0 to 1: nothing moves or sounds."""
        return 0.0, 1.0

    def ambiance_descriptor(self) -> tuple[int]:
        """Returns the excitement around: none."""
        return (0,)

    async def get_emotional_reaction(self) -> str:
        """Returns a person's reaction: unknown, as nobody is there."""
        return "unknown"

    def valence(self) -> str:
        """Returns the focused person's mood."""
        return "unknown"

    def attention(self) -> str:
        """Returns the focused person's attention."""
        return "unknown"

    def attention_zone(self) -> str:
        """Returns where the focused person looks."""
        return "unknown"

    def ambiance(self) -> str:
        """Returns the mood around."""
        return "calm"

    def valence_level(self) -> tuple[float, float]:
        """Returns valence and confidence."""
        return _UNKNOWN

    def attention_level(self) -> tuple[float, float]:
        """Returns attention and confidence."""
        return _UNKNOWN

    def ambiance_level(self) -> float:
        """Returns the agitation around, from 0 to 1."""
        return 0.0
