"""Users, moods and knowledge: what programs keep of people, in a simulation where nobody is."""

from typing import Any

from pepper_drake.robot_server.services.waiting import Module

_NOBODY = -1
"""`ALUserSession.getFocusedUser` when no user is with the robot."""

_UNKNOWN = (0.0, 0.0)
"""A value and the confidence that it has: none."""


class UserSession(Module):
    """ALUserSession: nobody is with the robot, and it knows no users."""

    def __init__(self) -> None:
        super().__init__("ALUserSession")

    def get_focused_user(self) -> int:
        """Returns the user with whom the robot is: none."""
        return _NOBODY

    def _none(self, *_: Any) -> list[Any]:
        """Returns no users, or no kinds of what could be kept of them."""
        return []

    get_user_list = _none
    get_open_user_sessions = _none
    get_permanent_user_list = _none
    find_users_with_binding = _none
    get_binding_list = _none
    get_binding_sources = _none
    get_user_data_sources = _none

    def _is_not(self, *_: Any) -> bool:
        """Returns that it is not so of a user whom the robot does not know."""
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
        """Returns how many users it knows: none."""
        return 0

    def get_num_open_sessions(self) -> int:
        """Returns how many users are there: none."""
        return 0

    def get_usid_from_ppid(self, _person: int) -> int:
        """Returns the user that a perceived person is: none."""
        return _NOBODY

    def get_ppid_from_usid(self, _user: int) -> int:
        """Returns the perceived person that a user is: none."""
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
    """ALUserInfo: what programs keep of a user by domain and key.

    Methods without a number mean the user with whom the robot is, which is nobody.
    """

    def __init__(self) -> None:
        super().__init__("ALUserInfo")
        self._values: dict[tuple[str, int, str], Any] = {}

    def get(self, *where: Any) -> Any:
        """Returns a value by (domain, user, key), None if there is none."""
        return self._values.get(_user_key(where))

    def set(self, *where_and_value: Any) -> bool:
        """Keeps a value by (domain, user, key); returns whether there is such a user."""
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
        """Forgets a value by (domain, user, key); returns whether there was one."""
        key = _user_key(where)
        if key not in self._values:
            return False
        del self._values[key]
        self._emit("userInfoRemoved", key[1], key[2])
        return True

    def remove_user(self, domain: str, user: int = _NOBODY) -> bool:
        """Forgets what a domain keeps of a user; returns whether there was anything."""
        gone = [key for key in self._values if key[:2] == (domain, user)]
        for key in gone:
            del self._values[key]
        return bool(gone)

    def get_type(self, domain: str, key: str) -> str:
        """Returns the type of a value of the user with whom the robot is."""
        raise ValueError(f"nobody is with the robot, and {domain} keeps no {key}")


def _user_key(where: Any) -> tuple[str, int, str]:
    """Returns domain, user and key of any of the forms in which programs give them."""
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
        """Replaces the objects that a subject has by a predicate."""
        for old in self.get_object(domain, subject, predicate):
            self.remove(domain, subject, predicate, old)
        self.add(domain, subject, predicate, value)

    def contains(self, domain: str, subject: str, predicate: str, value: str) -> bool:
        """Returns whether a triplet is there."""
        return (domain, subject, predicate, value) in self._triplets

    def get_subject(self, domain: str, predicate: str, value: str) -> list[str]:
        """Returns the subjects that have an object by a predicate."""
        return self._matching(domain, None, predicate, value, 1)

    def get_predicate(self, domain: str, subject: str, value: str) -> list[str]:
        """Returns the predicates by which a subject has an object."""
        return self._matching(domain, subject, None, value, 2)

    def get_object(self, domain: str, subject: str, predicate: str) -> list[str]:
        """Returns the objects that a subject has by a predicate."""
        return self._matching(domain, subject, predicate, None, 3)

    def query(self, domain: str, subject: str, predicate: str, value: str, *_: str) -> list[str]:
        """Returns what fits the one of the three that is given as "?"."""
        asked = [subject, predicate, value]
        if asked.count("?") != 1:
            raise ValueError('one of subject, predicate and object must be "?"')
        first, second, third = (None if part == "?" else part for part in asked)
        return self._matching(domain, first, second, third, 1 + asked.index("?"))

    def query_triplet(
        self, domain: str, subject: str, predicate: str, value: str
    ) -> list[list[str]]:
        """Returns the triplets that fit, where "?" fits all."""
        asked = (subject, predicate, value)
        return [
            list(triplet[1:])
            for triplet in self._triplets
            if triplet[0] == domain
            and all(a in ("?", t) for a, t in zip(asked, triplet[1:], strict=True))
        ]

    def reset_knowledge(self, domain: str) -> None:
        """Forgets a domain."""
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
    """ALMood: it sees nobody, so it knows no mood; every confidence is zero."""

    def __init__(self) -> None:
        super().__init__("ALMood")
        self._subscribers: dict[str, str] = {}

    def subscribe(self, name: str, mode: str) -> bool:
        """Takes who wants to know."""
        self._subscribers[name] = mode
        return True

    def unsubscribe(self, name: str) -> bool:
        """Forgets who wanted to know; returns whether it was known."""
        return self._subscribers.pop(name, None) is not None

    def get_subscribers_info(self) -> dict[str, str]:
        """Returns who wants to know, and how."""
        return dict(self._subscribers)

    def _person(self, _person: int = 0) -> tuple[Any, ...]:
        """Returns valence, attention, body language, smile, expressions: none is known."""
        return (_UNKNOWN, _UNKNOWN, (_UNKNOWN,), _UNKNOWN, (_UNKNOWN,) * 7)

    current_person_state = _person
    person_state_from_people_perception = _person
    person_state_from_user_session = _person

    def person_descriptor_from_people_perception(self, person: int) -> tuple[int, int]:
        """Refuses: nobody is seen."""
        raise ValueError(f"there is no person {person}")

    def persons(self) -> list[Any]:
        """Returns who is there: nobody."""
        return []

    def ambiance_state(self) -> tuple[float, float]:
        """Returns agitation and calm, from 0 to 1: nothing moves or sounds."""
        return 0.0, 1.0

    def ambiance_descriptor(self) -> tuple[int]:
        """Returns the excitement around: none."""
        return (0,)

    async def get_emotional_reaction(self) -> str:
        """Returns how a person reacts: as nobody is there, it is not known."""
        return "unknown"

    def valence(self) -> str:
        """Returns the mood of who is there."""
        return "unknown"

    def attention(self) -> str:
        """Returns how attentive who is there is."""
        return "unknown"

    def attention_zone(self) -> str:
        """Returns where who is there looks."""
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
