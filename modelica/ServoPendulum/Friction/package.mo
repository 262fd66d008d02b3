within ServoPendulum;
package Friction "What resists the shaft"
  annotation (Documentation(info="<html>
<p>Torques at the shaft, behind the gear. The speed below which dry friction is smoothed,
<code>v0 = 1e-4 rad/s</code>, lets a loaded shaft creep by a step of a 12 bit encoder in ten
seconds.</p>
</html>"));
end Friction;
