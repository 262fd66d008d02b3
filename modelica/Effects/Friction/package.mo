within Effects;
package Friction "What resists straight motion"
  annotation (Documentation(info="<html>
<p>The parts of the usual friction curve, one each, which add up: dry and viscous friction, a peak
close to standstill, a part that grows with the load, drag.</p>
<h4>Standstill</h4>
<p>Dry friction jumps where the velocity changes its sign. Here it has the slope
<code>tanh(v/v0)</code> instead: below <code>v0</code> a loaded body creeps and does not stick.
<code>v0</code> should be well below the velocities that matter, and no smaller than needed: a mass
<code>m</code> settles within <code>m*v0/coulomb</code>, which a solver must resolve.</p>
<h4>References</h4>
<p>B. Armstrong-Helouvry, P. Dupont, C. Canudas de Wit (1994), <em>A survey of models, analysis tools
and compensation methods for the control of machines with friction</em>, Automatica 30(7),
1083-1138; H. Olsson, K. J. Astrom, C. Canudas de Wit, M. Gafvert, P. Lischinsky (1998), <em>Friction
models and friction compensation</em>, European Journal of Control 4(3), 176-195.</p>
</html>"));
end Friction;
