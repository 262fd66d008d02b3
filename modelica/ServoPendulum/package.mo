within ;
package ServoPendulum "A servo that swings a pendulum: motor, gear, position controller"
  import Common = Effects;
  annotation (
    version="1.0",
    uses(Effects(version="1.0")),
    Documentation(info="<html>
<p>A small servo, such as those of robots, with an arm and a weight on its shaft. <code>Servo</code> is
the nominal model: a motor without losses behind its winding, a controller in proportion to the
position error, a pendulum. <code>Friction</code>, <code>Drive</code> and <code>Signals</code> hold
what it leaves out; the laws are mostly those of the library <code>Effects</code>.</p>
<h4>Signs</h4>
<p>Angles are zero where the arm hangs, and all torques on the shaft have one sign; friction and the
torque of the weight act against it.</p>
<h4>References</h4>
<p>M. Duclusaud, G. Passault, V. Padois, O. Ly (2025), <em>Extended friction models for the physics
simulation of servo actuators</em>, IEEE ICRA.</p>
</html>"));
end ServoPendulum;
