within PositioningStage.Effects;
model DriveDeadZone "a drive that does nothing at small commands"
  extends Common.Signals.DeadZone(zone(unit="N", max=100.0));
  annotation (
    __Workbench(effect(
      size="zone", matters=0.5, slots={"drive"}, after="DryFriction",
      separation="the force at a blocked carriage")),
    Documentation(info="<html>
<p>Of an amplifier.</p>
</html>"));
end DriveDeadZone;
