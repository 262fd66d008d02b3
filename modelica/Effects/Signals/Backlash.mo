within Effects.Signals;
model Backlash "Play in gears or joints, by which the value comes behind"
  extends Play;
equation
  y = u - noEvent(max(-play, min(play, felt - centre)));
  annotation (Documentation(info="<html>
<p><code>y = u - play</code> after a rise, <code>u + play</code> after a fall, and where it was in
between; its size is <code>play</code>.</p>
<h4>Limits</h4>
<p>The driven side follows at once and has no inertia of its own.</p>
<h4>References</h4>
<p>M. Nordin, P.-O. Gutman (2002), <em>Controlling mechanical systems with backlash: a survey</em>,
Automatica 38(10), 1633-1649.</p>
</html>"));
end Backlash;
