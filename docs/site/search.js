/* The theme's search reads each word of a question as the beginning of a word, so that "a" and "do" find every page:
it gets the question without the words that say nothing. */
"use strict";
{
  const EMPTY = /\b(?:add|an?|and|another|any|are|between|can|could|do|does|for|from|get|has|have|how|i|in|is|it|its|make|my|need|no|of|on|one|or|run|runs|say|says|several|that|the|there|this|to|two|use|using|want|was|what|when|where|which|who|why|will|with|you|your)\b\s*/gi;
  const post = Worker.prototype.postMessage;
  Worker.prototype.postMessage = function (message, ...rest) {
    if (typeof message?.data === "string")
      message = { ...message, data: message.data.replace(EMPTY, "") || message.data };
    return post.call(this, message, ...rest);
  };
}
