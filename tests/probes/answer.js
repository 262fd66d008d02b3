await ready; // figures have their samples
if (then) await then();
const answer = document.createElement("pre");
answer.id = "probe";
answer.textContent = JSON.stringify({ ...told, errors });
document.body.append(answer);
})();
</script>
