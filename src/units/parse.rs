//! The grammar of unit strings.
//!
//! ```text
//! unit    = [number ["/" number]] product
//! product = factor { ("*" | "·" | " " | "/") factor }      "/" binds to the next factor only; after a "/" no product
//! factor  = ("sqrt" | "√" | "rt") factor | (name | "(" unit ")") [power]
//! power   = "^" half-integer | "²" | "2" | "-1" …
//! ```

use super::{Dimension, Factor, Unit, UnitError, symbol};

/// No unit is longer; bounds the recursion.
const LONGEST: usize = 120;

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(f64),
    Name(String),
    /// An exponent that stands directly at a name: doubled.
    Power(i8),
    Times,
    Over,
    Caret,
    Root,
    Minus,
    Open,
    Close,
}

/// A product in the making.
#[derive(Clone, Debug, Default)]
struct Product {
    number: Option<f64>,
    factors: Vec<Factor>,
}

/// Why a text is no unit; the text itself is added by [`unit`].
type Problem = String;

pub(super) fn unit(text: &str) -> Result<Unit, UnitError> {
    let shown = display_text(&super::plain(&text.replace(char::is_whitespace, " ")));
    let unknown = |hint: Problem| UnitError::Unknown { found: shown.clone(), hint };
    if shown.is_empty() {
        return Err(unknown("a unit is expected, for example deg/s".into()));
    }
    if text.chars().count() > LONGEST {
        return Err(UnitError::Unknown {
            found: shown.chars().take(30).chain("…".chars()).collect(),
            hint: format!("longer than {LONGEST} characters"),
        });
    }
    let tokens = tokens(&shown).map_err(unknown)?;
    let mut parser = Parser { tokens, at: 0 };
    let product = parser.product().map_err(unknown)?;
    if parser.at < parser.tokens.len() {
        return Err(unknown("unbalanced parentheses".into()));
    }
    finish(&shown, product).map_err(unknown)
}

/// Without surrounding spaces and one surrounding pair of square brackets.
fn display_text(text: &str) -> String {
    let text = text.trim();
    let inner = text.strip_prefix('[').and_then(|t| t.strip_suffix(']')).filter(|t| !t.contains(['[', ']']));
    inner.unwrap_or(text).trim().to_string()
}

fn finish(text: &str, product: Product) -> Result<Unit, Problem> {
    let mut dimension = Dimension::NONE;
    for factor in &product.factors {
        dimension = dimension
            .checked_times(factor.symbol.dimension, factor.half_power)
            .ok_or_else(|| "the powers are larger than those of any unit".to_string())?;
    }
    let scale = product.number.unwrap_or(1.0) * product.factors.iter().map(Factor::scale).product::<f64>();
    if !(scale.is_finite() && scale > 0.0) {
        return Err("the number in front must be positive and finite".into());
    }
    Ok(Unit { text: text.to_string(), scale, dimension, factors: product.factors })
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
}

impl Parser {
    fn peek(&self) -> Option<&Token> {
        self.tokens.get(self.at)
    }
    fn take(&mut self, token: &Token) -> bool {
        let found = self.peek() == Some(token);
        self.at += usize::from(found);
        found
    }

    fn product(&mut self) -> Result<Product, Problem> {
        let mut product = Product { number: self.leading_number(), ..Product::default() };
        let mut first = product.number.is_none();
        let mut divided = false;
        while let Some(token) = self.peek() {
            let over = match token {
                Token::Close => break,
                _ if first => false,
                Token::Over => {
                    self.at += 1;
                    true
                }
                Token::Times => {
                    self.at += 1;
                    false
                }
                _ => false,
            };
            if divided && !over {
                return Err("a product after '/' can be read in two ways; write a/b/c or a/(b*c), \
                            for example deg/s/sqrt(Hz)"
                    .into());
            }
            divided |= over;
            let factor = self.factor()?;
            if let Some(number) = factor.number {
                let number = if over { 1.0 / number } else { number };
                product.number = Some(product.number.unwrap_or(1.0) * number);
            }
            for mut f in factor.factors {
                f.half_power = if over { -f.half_power } else { f.half_power };
                product.factors.push(f);
            }
            first = false;
        }
        if first {
            return Err("a unit name is missing, for example deg/s".into());
        }
        Ok(product)
    }

    /// `131`, `1/131`, `0.061`: numbers before the first name.
    fn leading_number(&mut self) -> Option<f64> {
        let Some(Token::Number(number)) = self.peek() else { return None };
        let mut number = *number;
        self.at += 1;
        if let (Some(Token::Over), Some(Token::Number(divisor))) = (self.peek(), self.tokens.get(self.at + 1)) {
            number /= divisor;
            self.at += 2;
        }
        Some(number)
    }

    fn factor(&mut self) -> Result<Product, Problem> {
        if self.take(&Token::Root) {
            let _ = self.take(&Token::Minus); // rt-hr
            return root(self.factor()?);
        }
        let token = self.peek().cloned();
        self.at += 1;
        let base = match token {
            Some(Token::Name(name)) => {
                let symbol = symbol::find(&name).ok_or_else(|| format!("'{name}': {}", symbol::hint(&name)))?;
                Product { number: None, factors: vec![Factor { symbol, half_power: 2 }] }
            }
            Some(Token::Open) => {
                let inner = self.product()?;
                if !self.take(&Token::Close) {
                    return Err("unbalanced parentheses".into());
                }
                inner
            }
            Some(Token::Number(_)) => {
                return Err("a number belongs in front, for example \"1/131 deg/s\"".into());
            }
            Some(Token::Minus) => return Err("a '-' is not expected here; powers are written s^-1".into()),
            Some(_) | None => return Err("a unit name is missing, for example deg/s".into()),
        };
        match self.power()? {
            Some(half_power) => raise(base, half_power),
            None => Ok(base),
        }
    }

    /// Doubled exponent after a name or a parenthesis.
    fn power(&mut self) -> Result<Option<i8>, Problem> {
        if let Some(Token::Power(half)) = self.peek() {
            let half = *half;
            self.at += 1;
            return Ok(Some(half));
        }
        if !self.take(&Token::Caret) {
            return Ok(None);
        }
        let expected = || "a power is a half-integer number, for example s^-2, s^1.5, s^(3/2)".to_string();
        let enclosed = self.take(&Token::Open);
        let sign = if self.take(&Token::Minus) { -1.0 } else { 1.0 };
        let value = match self.peek() {
            Some(Token::Number(value)) => sign * *value,
            Some(Token::Power(half)) => sign * f64::from(*half) / 2.0,
            _ => return Err(expected()),
        };
        self.at += 1;
        let mut value = value;
        // s^(3/2); without parentheses only the half is read as a fraction: Hz^-1/2
        if self.peek() == Some(&Token::Over)
            && let Some(Token::Number(divisor)) = self.tokens.get(self.at + 1)
            && (enclosed || (*divisor == 2.0 && value % 2.0 != 0.0))
        {
            value /= divisor;
            self.at += 2;
        }
        if enclosed && !self.take(&Token::Close) {
            return Err(expected());
        }
        half_power(value).map(Some).ok_or_else(expected)
    }
}

fn half_power(value: f64) -> Option<i8> {
    let doubled = 2.0 * value;
    (doubled.is_finite() && doubled.fract() == 0.0 && doubled != 0.0 && doubled.abs() <= 12.0).then_some(doubled as i8)
}

fn root(product: Product) -> Result<Product, Problem> {
    let mut product = product;
    for factor in &mut product.factors {
        if factor.half_power % 2 != 0 {
            return Err("powers go in halves; a fourth root is no unit".into());
        }
        factor.half_power /= 2;
    }
    product.number = product.number.map(f64::sqrt);
    Ok(product)
}

fn raise(product: Product, half_power: i8) -> Result<Product, Problem> {
    let mut product = product;
    for factor in &mut product.factors {
        let power = i16::from(factor.half_power) * i16::from(half_power);
        if power % 2 != 0 || power.abs() > 48 {
            return Err("powers go in halves and are small".into());
        }
        factor.half_power = (power / 2) as i8;
    }
    product.number = product.number.map(|n| n.powf(f64::from(half_power) / 2.0));
    Ok(product)
}

fn tokens(text: &str) -> Result<Vec<Token>, Problem> {
    let text = text.replace("_per_", "/").replace("**", "^").replace("micro-", "u").replace("milli-", "m");
    let letters: Vec<char> = text.chars().collect();
    let mut tokens = Vec::new();
    let mut at = 0;
    while let Some(&c) = letters.get(at) {
        let next = letters.get(at + 1).copied().unwrap_or(' ');
        if c.is_whitespace() {
            at += 1;
        } else if c.is_ascii_digit() || (c == '.' && next.is_ascii_digit()) {
            let (number, length) = number(&letters[at..])?;
            tokens.push(Token::Number(number));
            at += length;
        } else if let Some((value, length)) = superscript(&letters[at..]) {
            tokens.push(Token::Power(half_power(value).ok_or("a power is a half-integer number, for example s²")?));
            at += length;
        } else if is_letter(c) {
            let length = name_length(&letters[at..]);
            let name: String = letters[at..at + length].iter().collect();
            at += length;
            let is_name = push_name(&mut tokens, name);
            // s-1, s2: the power stands directly at the name
            if is_name && let Some((value, length)) = attached_power(&letters[at..]) {
                let half = half_power(value).ok_or("a power is a half-integer number, for example s^2")?;
                tokens.push(Token::Power(half));
                at += length;
            }
        } else {
            tokens.push(match c {
                '*' | '·' | '⋅' | '×' | '.' => Token::Times,
                '/' | '∕' | '⁄' => Token::Over,
                '^' => Token::Caret,
                '√' => Token::Root,
                '-' | '−' | '‐' | '‑' => Token::Minus,
                '(' | '[' | '{' => Token::Open,
                ')' | ']' | '}' => Token::Close,
                _ => return Err(format!("'{c}' is not expected in a unit, for example deg/s/sqrt(Hz)")),
            });
            at += 1;
        }
    }
    Ok(tokens)
}

fn is_letter(c: char) -> bool {
    c.is_alphabetic() || matches!(c, '°' | '˚' | '′' | '″' | '℃' | '℉')
}

/// `°` and its kin are names of one letter, except in `°C` and `°F`.
fn name_length(letters: &[char]) -> usize {
    match letters {
        ['°' | 'º' | '˚', 'C' | 'F', rest @ ..] if !rest.first().is_some_and(|c| c.is_alphabetic()) => 2,
        ['°' | 'º' | '˚' | '′' | '″', ..] => 1,
        _ => letters.iter().take_while(|c| c.is_alphabetic() && !matches!(**c, 'º' | 'ª')).count().max(1),
    }
}

/// Splits `rtHz` and `sqrtHz`, reads `per` as a slash. True when a unit's name was pushed last.
fn push_name(tokens: &mut Vec<Token>, name: String) -> bool {
    let plain = match name.as_str() {
        "°C" | "ºC" | "˚C" => "degC",
        "°F" | "ºF" | "˚F" => "degF",
        other => other,
    };
    if plain == "per" {
        tokens.push(Token::Over);
        return false;
    }
    if symbol::find(plain).is_none() {
        for root in ["sqrt", "root", "rt"] {
            let Some(rest) = plain.strip_prefix(root) else { continue };
            if rest.is_empty() {
                tokens.push(Token::Root);
                return false;
            }
            if symbol::find(rest).is_some() {
                tokens.push(Token::Root);
                tokens.push(Token::Name(rest.into()));
                return true;
            }
        }
    }
    tokens.push(Token::Name(plain.into()));
    true
}

/// Digits, with a decimal point and an exponent of ten.
fn number(letters: &[char]) -> Result<(f64, usize), Problem> {
    let digits = |from: usize| letters[from..].iter().take_while(|c| c.is_ascii_digit()).count();
    let mut length = digits(0);
    if letters.get(length) == Some(&'.') && (digits(length + 1) > 0 || length > 0) {
        length += 1 + digits(length + 1);
    }
    if matches!(letters.get(length), Some('e' | 'E')) {
        let sign = usize::from(matches!(letters.get(length + 1), Some('+' | '-')));
        let from = (length + 1 + sign).min(letters.len());
        let exponent = digits(from);
        if exponent > 0 {
            length = from + exponent;
        }
    }
    let text: String = letters[..length].iter().collect();
    let value: f64 = text.parse().map_err(|_| format!("'{text}' is not a number"))?;
    Ok((value, length))
}

/// `⁻¹`, `²`, `³`, `½`.
fn superscript(letters: &[char]) -> Option<(f64, usize)> {
    const DIGITS: [char; 10] = ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹'];
    let digit = |c: &char| DIGITS.iter().position(|d| d == c);
    let sign = usize::from(letters.first() == Some(&'⁻'));
    let first = letters.get(sign)?;
    if *first == '½' {
        return Some((if sign == 1 { -0.5 } else { 0.5 }, sign + 1));
    }
    let value = digit(first)? as f64;
    let length = sign + 1;
    // ⁻¹ᐟ² and ⁻¹⁄²
    if let [slash, '²', ..] = letters.get(length..)?
        && matches!(slash, 'ᐟ' | '⁄' | '′')
    {
        return Some((if sign == 1 { -value / 2.0 } else { value / 2.0 }, length + 2));
    }
    if letters.get(length).and_then(digit).is_some() {
        return Some((f64::NAN, length));
    }
    Some((if sign == 1 { -value } else { value }, length))
}

/// `-1` or `2` right behind a name, as in `m s-2` and `m/s2`.
fn attached_power(letters: &[char]) -> Option<(f64, usize)> {
    let sign = usize::from(matches!(letters.first(), Some('-' | '−')));
    let value = f64::from(letters.get(sign)?.to_digit(10)?);
    if matches!(letters.get(sign + 1), Some(c) if c.is_ascii_digit() || *c == '.') {
        return Some((f64::NAN, sign + 1));
    }
    Some((if sign == 1 { -value } else { value }, sign + 1))
}
