/* The theme's search takes each word of a question as the beginning of a word. It gets the words that say something,
without their endings, so that "installation" finds "install"; words of one or two letters, such as J and PI, are whole.
Words that stand side by side, as one, come first: pages of laws and plants have their names so as tags, see hook.py. */
"use strict";
{
  const EMPTY = new Set(
    ("a about add all allow an and another any are as at be between by can control could did do does during each every for " +
    "from get give happens has have how i if in into is it its just make many me mean means mode modes much my need " +
    "no not of on one only or our over own please run say says several should show simulate simulation simulations so " +
    "some than that the their them then there these this to too two up use used using want was way we were what when " +
    "where which who why will with without work works would you your").split(" "));
  const ENDINGS = [
    [/(?<=[a-z](?:ch|sh|ss|x))es$/, ""],
    [/(?<=[a-z]{2}[^us])s$/, ""],
    [/(?<=[a-z]{4})(?:i[sz]e[drs]?|i[sz]ing|i[sz]ation|ation|(?<=[a-z]{5})ity|ness|ates?|ated|ating)$/, ""],
    [/(?<=[a-z]{2}ct)ion$/, ""],
    [/(?<=[aeiouy][a-z]+)(?:ing|(?<!e)ed)$/, ""],
    [/([bdgmnprt])\1$/, "$1"],
  ];
  const LONGEST = 4; // words of a name
  const stem = (word) => ENDINGS.reduce((left, [ending, rest]) => left.replace(ending, rest), word);
  const asked = (question) => {
    const words = question.toLowerCase().replace(/['’]s\b/g, "").match(/[\p{L}\d]+/gu) ?? [];
    const telling = words.filter((word) => !EMPTY.has(word));
    const parts = telling.length ? telling : words;
    const names = [words.join("") + "^10"];
    for (let i = 0; i < parts.length; i++) {
      for (let j = i + 2; j <= Math.min(parts.length, i + LONGEST); j++) names.push(parts.slice(i, j).join("") + "^3");
    }
    return [...parts.map((word) => (word.length < 3 ? word + "^1" : `${stem(word)} ${word}^1`)), ...names].join(" ");
  };
  const post = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...rest) {
    if (typeof message?.data === "string") message = { ...message, data: asked(message.data) };
    return post.call(this, message, ...rest);
  };
}
