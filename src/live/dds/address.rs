//! `ros2:[TOPICS][,OPTION=VALUE]`: names of topics, and the domain that has them.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr};
use std::str::FromStr;
use svl_core::{Error, Result};

/// Topics in a domain of DDS.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// The user's text.
    text: String,
    pub topics: Vec<String>,
    pub domain: u16,
    /// The address of the network interface to use; all by default.
    pub(super) interface: Option<IpAddr>,
}

/// The highest domain whose ports are valid.
const MAX_DOMAIN: u16 = 232;

impl FromStr for Address {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        Self::read(text, |name| std::env::var(name).ok())
    }
}

impl Address {
    /// `variable`: the value of an environment variable, those of ROS being defaults.
    fn read(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<Self> {
        let is = |name: &str, value: &str| variable(name).is_some_and(|found| found == value);
        let is_local =
            is("ROS_LOCALHOST_ONLY", "1") || is("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST");
        let mut address = Self {
            text: text.to_owned(),
            topics: Vec::new(),
            domain: match variable("ROS_DOMAIN_ID").filter(|value| !value.is_empty()) {
                Some(value) => domain("ROS_DOMAIN_ID", &value)?,
                None => 0,
            },
            interface: is_local.then_some(Ipv4Addr::LOCALHOST.into()),
        };
        let rest = text.strip_prefix("ros2:").unwrap_or(text);
        for part in rest.split(',').filter(|part| !part.is_empty()) {
            match part.split_once('=') {
                None if is_topic(part) => address.topics.push(part.to_owned()),
                None => {
                    let reason = format!(
                        "{text}: '{part}' is no topic: a name begins with /, and between / are \
                         letters, digits and _, with no digit first"
                    );
                    return Err(Error::Usage(reason));
                }
                Some(("domain", value)) => address.domain = domain(text, value)?,
                Some(("interface", value)) => {
                    let reason = |_| {
                        let expected = "expected the address of a network interface, as 127.0.0.1";
                        Error::Usage(format!("{text}: interface={value}: {expected}"))
                    };
                    address.interface = Some(value.parse().map_err(reason)?);
                }
                Some((name, _)) => {
                    let reason = "no such option; expected domain or interface";
                    return Err(Error::Usage(format!("{text}: {name}: {reason}")));
                }
            }
        }
        Ok(address)
    }

    /// The left and the right topic, if the address names any.
    ///
    /// # Errors
    /// [`Error::Usage`] for one topic, or more than two.
    pub fn pair(&self) -> Result<Option<[String; 2]>> {
        match &self.topics[..] {
            [] => Ok(None),
            [left, right] => Ok(Some([left.clone(), right.clone()])),
            _ => {
                let cure = "name two topics, left and right, or none";
                Err(Error::Usage(format!("{self}: {cure}")))
            }
        }
    }
}

/// True for a name by the rules of ROS 2, and for the root.
fn is_topic(name: &str) -> bool {
    let is_word = |word: &str| {
        let begins = |c: char| c.is_ascii_alphabetic() || c == '_';
        word.starts_with(begins) && word.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    let words = name.trim_end_matches('/').split('/').skip(1);
    name.starts_with('/') && words.into_iter().all(is_word)
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)
    }
}

fn domain(name: &str, value: &str) -> Result<u16> {
    let domain = value.parse().ok().filter(|domain| *domain <= MAX_DOMAIN);
    domain.ok_or_else(|| {
        Error::Usage(format!(
            "{name}: domain '{value}': expected 0 .. {MAX_DOMAIN}"
        ))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, variables: &[(&str, &str)]) -> Result<Address> {
        Address::read(text, |name| {
            let found = variables.iter().find(|(known, _)| *known == name);
            found.map(|(_, value)| (*value).to_owned())
        })
    }

    #[test]
    fn options_take_precedence_over_variables_of_ros() {
        let all = read("ros2:", &[]).unwrap();
        assert_eq!((all.topics.len(), all.domain, all.interface), (0, 0, None));
        let variables = [("ROS_DOMAIN_ID", "7"), ("ROS_LOCALHOST_ONLY", "1")];
        let local = Some(IpAddr::V4(Ipv4Addr::LOCALHOST));
        let named = read("ros2:/a,/b", &variables).unwrap();
        assert_eq!(named.topics, ["/a", "/b"]);
        assert_eq!((named.domain, named.interface), (7, local));
        let range = [("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")];
        assert_eq!(read("ros2:", &range).unwrap().interface, local);
        let given = read("ros2:domain=3,interface=10.0.0.2", &variables).unwrap();
        assert_eq!(given.domain, 3);
        assert_eq!(given.interface, Some([10, 0, 0, 2].into()));
    }

    #[test]
    fn wrong_options_are_named() {
        for (text, named) in [
            ("ros2:left", "'left'"),
            ("ros2:/1svl", "'/1svl'"),
            ("ros2:/svl points", "'/svl points'"),
            ("ros2:/a//b", "'/a//b'"),
            ("ros2:/ä", "'/ä'"),
            ("ros2:domain=233", "'233'"),
            ("ros2:interface=eth0", "interface=eth0"),
            ("ros2:/a,/b,qos=best", "qos"),
        ] {
            let error = read(text, &[]).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
            assert!(error.to_string().contains(named), "{error}");
        }
        assert!(read("ros2:", &[("ROS_DOMAIN_ID", "one")]).is_err());
    }
}
