within WheelsetRig;
package Interfaces "Connectors and partial models of the mechanics"
  annotation (Documentation(info="<html>
<p>The grammar of <code>Modelica.Mechanics.MultiBody</code> with small rotations: a frame carries a
position and three angles instead of a rotation matrix, and lever arms keep the length and
direction they have at rest. Forces that act along these levers do exactly the work that the
linearised motion stores or dissipates, so energy is conserved exactly.</p>
<h4>Limits</h4>
<p>An angle of 10 mrad costs 5e-5 of a lever's length; the rig's angles stay below that. Static
forces have no geometric stiffness. Only the spin of wheelset and roller is unlimited: it is
carried by <code>Flange</code>.</p>
</html>"));
end Interfaces;
