within ServoPendulum.Signals;
model HeavierArm "A pendulum that is heavier than its weight alone"
  extends Common.Signals.Gain(gain(min=-0.2, max=0.2));
  annotation (
    __Workbench(effect(
      size="gain", matters=0.02, slots={"weight"},
      separation="a spring balance at the end of the level arm")),
    Documentation(info="<html>
<p>The arm itself, screws, a length that was measured to the wrong point. With all else free, masses
and torques may grow together and nothing moves otherwise.</p>
</html>"));
end HeavierArm;
