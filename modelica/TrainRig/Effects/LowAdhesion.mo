within TrainRig.Effects;
model LowAdhesion "a rail with other friction than the crew says"
  extends Common.Interfaces.Signal;
  parameter Real gain(unit="1", min=-0.9, max=0.5) = 0.0 "Relative change of the friction";
equation
  y = u*(1.0 + gain);
  annotation (
    __Workbench(effect(
      size="gain", matters=0.15, slots={"adhesion"},
      separation="the rail, looked at; sand")),
    Documentation(info="<html>
<p>It shows only near the limit of adhesion.</p>
</html>"));
end LowAdhesion;
